"""Engine calculix: a model becomes an input deck, a run of ccx, and a load path read from its files."""
