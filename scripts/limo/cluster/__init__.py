"""Sweeps on a cluster: what jobs ask for, which jobs a folder has, and what must be right before the first is submitted."""
