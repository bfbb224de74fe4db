"""Errors of settings against the finest mesh, and their price."""
