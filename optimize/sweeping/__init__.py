"""The pieces of the sweep: its configuration and its figures."""
