"""Cases as xarray datasets, tables and fields; every variable with its name, unit and symbol."""
