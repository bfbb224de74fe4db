"""Node tables, shape functions, the flat mesh, its layers and surfaces."""
