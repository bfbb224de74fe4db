"""Many cases as one xarray dataset; every variable with its name, unit and symbol."""
