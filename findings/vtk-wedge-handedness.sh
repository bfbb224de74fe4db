#!/usr/bin/env bash
# VTK 9.5.2, 9.6.1 and 9.7.2 do not agree on which linear wedge is inside out, and 9.7.2 does not agree with itself.
# A brick of volume 1 and a wedge of volume 0.5 share a face, in the node order of CalculiX, Abaqus and gmsh.
#   - volume of the wedge (vtkCellSizeFilter): -0.5, -0.5, +0.5;
#   - scaled Jacobian of the wedge (vtkCellQuality): +0.82, -1.15, +0.82;
#   - volume inside the surface of both, which is 1.5: by vtkGeometryFilter -0.17, -0.17, +1.5; by vtkDataSetSurfaceFilter
#     (PyVista 0.49 uses it in extract_surface unless told otherwise) -0.17 in all: bricks face outward, wedges inward;
#   - volume of the wedge of 15 nodes: -0.5, -0.5, +0.5, though its surface faces outward in all three.
# VTK's documents put the first triangle of the linear wedge facing outward, the order that 9.7.2 calls negative. Release
# notes mention that the quality filter reorders wedges; we found none on the sign of the volume.
# Why it matters: wedges fill the apex of ventricles. An upgrade turns good elements into bad ones, and cavity volumes
# and pressure loads over surfaces of mixed meshes are wrong without a warning.
# What to do: pin VTK, do not judge wedges by their sign, use vtkGeometryFilter (PyVista: algorithm="geometry") with 9.7.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

cat > wedge.py <<'END'
from vtkmodules.vtkCommonCore import vtkPoints, vtkVersion
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkTriangleFilter
from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter, vtkGeometryFilter
from vtkmodules.vtkFiltersVerdict import vtkCellQuality, vtkCellSizeFilter

HEXAHEDRON, WEDGE, QUADRATIC_WEDGE = 12, 13, 26
POINTS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1), (2, 0, 0), (2, 0, 1)]
BRICK, SIDE = [0, 1, 2, 3, 4, 5, 6, 7], [1, 8, 2, 5, 9, 6]  # the wedge's first triangle faces the second: Abaqus's order


def mesh(*cells):
    grid, points = vtkUnstructuredGrid(), vtkPoints()
    corners = [POINTS[i] for i in SIDE]
    edges = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
    middles = [[(p + q) / 2 for p, q in zip(corners[a], corners[b], strict=True)] for a, b in edges]
    for point in POINTS + middles:
        points.InsertNextPoint(point)
    grid.SetPoints(points)
    for kind, nodes in cells:
        grid.InsertNextCell(kind, len(nodes), nodes)
    return grid


def last(grid, tool, name):
    """The tool's value for the last cell."""
    tool.SetInputData(grid)
    tool.Update()
    return tool.GetOutput().GetCellData().GetArray(name).GetValue(grid.GetNumberOfCells() - 1)


def enclosed(grid, surface):
    """Volume inside the surface by the divergence theorem, seen from the origin."""
    surface.SetInputData(grid)
    triangles = vtkTriangleFilter()
    triangles.SetInputConnection(surface.GetOutputPort())
    triangles.Update()
    output, total = triangles.GetOutput(), 0.0
    for i in range(output.GetNumberOfCells()):
        a, b, c = (output.GetCell(i).GetPoints().GetPoint(k) for k in range(3))
        total += sum(a[i] * (b[j] * c[k] - b[k] * c[j]) for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))) / 6
    return total


wedge, mixed = mesh((WEDGE, SIDE)), mesh((HEXAHEDRON, BRICK), (WEDGE, SIDE))
quadratic = mesh((QUADRATIC_WEDGE, SIDE + list(range(10, 19))))
quality = vtkCellQuality()
quality.SetQualityMeasureToScaledJacobian()
values = (
    last(wedge, vtkCellSizeFilter(), "Volume"),
    last(wedge, quality, "CellQuality"),
    enclosed(mixed, vtkGeometryFilter()),
    enclosed(mixed, vtkDataSetSurfaceFilter()),
    last(quadratic, vtkCellSizeFilter(), "Volume"),
    enclosed(quadratic, vtkDataSetSurfaceFilter()),
)
print(vtkVersion().GetVTKVersion(), *(f"{value:.2f}" for value in values))
END

for version in 9.5.2 9.6.1 9.7.2; do
    python3 -m venv "venv$version"
    "venv$version/bin/pip" install -qq --disable-pip-version-check --no-deps "vtk==$version"
    "venv$version/bin/python" wedge.py >> seen
    rm -rf "venv$version"
done
cat > expected <<'END'
9.5.2 -0.50 0.82 -0.17 -0.17 -0.50 0.50
9.6.1 -0.50 -1.15 -0.17 -0.17 -0.50 0.50
9.7.2 0.50 0.82 1.50 -0.17 0.50 0.50
END
echo "VTK; wedge of 6 nodes: volume, scaled Jacobian; inside of brick and wedge: vtkGeometryFilter, vtkDataSetSurfaceFilter;"
echo "wedge of 15 nodes: volume, inside"
cat seen
if diff -q seen expected > /dev/null; then echo "as described"; else echo "CHANGED: expected"; cat expected; exit 1; fi
