"""Other methods of optimisation on the package's own problems, counted alike."""
