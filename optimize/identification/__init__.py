"""The pieces of the identification from recordings."""
