"""An independent NumPy/SciPy computation of the oblique impact, the referee of the tests."""
