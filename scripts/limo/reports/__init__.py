"""Documents made of kept data and of the code."""
