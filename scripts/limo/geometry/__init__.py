"""The flat pattern as plane curves, and as a cutting pattern to scale; no mesher, no YAML."""
