"""Documents made of kept data."""
