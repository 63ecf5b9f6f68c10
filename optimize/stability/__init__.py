"""The pieces of the stability map: its scenes and its figures."""
