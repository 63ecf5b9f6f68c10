"""The same impact and the same beam by other codes, each on its own equations of motion."""
