"""What a laboratory hands over: tensile tests and measured pressure-volume curves, read with their units."""

_TABLE_CODE = ("text", "numbers", "names", "lines", "units", "table")
#: modules whose code decides what is read of a tensile test and fitted to it
TENSILE_CODE = tuple(f"bench.{name}" for name in (*_TABLE_CODE, "specimens", "line", "tensile"))
#: the same for measured curves and what is compared with them
CURVE_CODE = tuple(f"bench.{name}" for name in (*_TABLE_CODE, "curves", "compare"))
