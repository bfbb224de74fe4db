"""Engines turn a model into a load path: what one is (``engine``), what it returns (``load_path``), by name (``find``)."""
