"""The flat pattern as plane curves; no mesher, no YAML."""
