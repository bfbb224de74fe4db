"""What a laboratory hands over: tensile tests and measured pressure-volume curves, read with their units."""
