"""The pieces of the sensitivity study."""
