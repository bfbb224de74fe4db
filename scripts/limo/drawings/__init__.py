"""Drawings as a source of devices: what a DXF or SVG file holds, which pattern that is, and the device made of it."""
