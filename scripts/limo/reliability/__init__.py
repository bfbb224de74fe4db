"""The stress test, and equal and nearly equal runs of one case."""
