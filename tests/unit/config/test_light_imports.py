"""What the Snakefile imports and what planning takes: no library of meshes, solvers or figures, which would take seconds.

Nor does a solve import what most solves have no use for.
"""

from __future__ import annotations

import re
import subprocess
import sys

HEAVY = {"scipy", "pandas", "xarray", "netCDF4", "matplotlib", "vtkmodules", "pyvista", "shapely", "gmsh", "meshio", "numba"}
PLANNING = """
import sys
from pathlib import Path
{imports}
project = load_config("config/config.yaml", ["all"])
plan = make_plan(project.with_builds({{"calculix": "2.20"}}), Path("nowhere"))
plan_costs(plan)
print(*sorted({{name.partition(".")[0] for name in sys.modules}}))
"""


def test_planning_loads_none_of_the_heavy_libraries(root):
    imports = re.findall(r"^from limo.*$", (root / "Snakefile").read_text(), re.MULTILINE)
    command = [sys.executable, "-c", PLANNING.format(imports="\n".join(imports))]
    for _ in range(2):  # the first one may have to try layouts
        done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert {"limo", "pydantic", "yaml"} <= loaded
    assert not HEAVY & loaded


def test_a_solve_loads_no_search_of_neighbours_before_it_needs_one(root):
    """It carries a state to another mesh; importing it takes a tenth of a second."""
    code = "import sys, limo.solve.case, limo.engines.newton.iteration\nprint('scipy.spatial' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]
