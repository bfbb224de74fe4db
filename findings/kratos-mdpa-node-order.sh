#!/usr/bin/env bash
# meshio 5.3.5 writes bricks of 20 nodes for Kratos in VTK's node order; Kratos 10.4.4 expects another, without a word.
# Kratos numbers the four upright edges before the four upper ones; VTK, CalculiX and Abaqus number them last.
#   - a brick of 3 mm3, written by meshio as .mdpa and read by Kratos, has a volume of -0.733 mm3;
#     with the middle nodes of these edges exchanged it has 3 mm3;
#   - meshio reads its own file back unchanged, so a round trip shows nothing;
#   - Kratos's own VTK output exchanges the nodes, so there the difference is known;
#   - the wedge of 15 nodes has the same trap: 0.0009 mm3 for 0.5.
# One edit is needed before Kratos reads the file at all: meshio writes the name of the geometry, Hexahedra3D20, where
# Kratos wants that of an element.
# Why it matters: Kratos is the open peer for membranes and inflatables, and meshio the short way to it from other meshes.
# What to do: exchange nodes 13-16 and 17-20 (C3D15: 10-12 and 13-15) and check DomainSize of every element.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check KratosMultiphysics==10.4.4 meshio==5.3.5 numpy==2.4.6

cat > order.py <<'END'
import pathlib
import sys

import KratosMultiphysics as Kratos
import meshio
import numpy as np

BRICK = np.array([(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0), (0, 0, 1.5), (2, 0, 1.5), (2, 1, 1.5), (0, 1, 1.5)])
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
WEDGE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)], float)
WEDGE_EDGES = [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)]


def with_middles(corners, edges):
    return np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in edges]])


def volume(order):
    """Kratos's volume of the brick in meshio's file, its nodes taken in this order."""
    mesh = meshio.Mesh(with_middles(BRICK, EDGES), [("hexahedron20", np.array([order]))])
    meshio.write("brick.mdpa", mesh)
    assert np.array_equal(meshio.read("brick.mdpa").cells[0].data, [order])
    text = pathlib.Path("brick.mdpa").read_text()
    pathlib.Path("edited.mdpa").write_text(text.replace("Elements Hexahedra3D20", "Elements Element3D20N"))
    part = Kratos.Model().CreateModelPart("brick")
    Kratos.ModelPartIO("edited").ReadModelPart(part)
    return next(element.GetGeometry().DomainSize() for element in part.Elements)


def wedge_volume(order):
    part = Kratos.Model().CreateModelPart("wedge")
    for i, point in enumerate(with_middles(WEDGE, WEDGE_EDGES), 1):
        part.CreateNewNode(i, *point)
    element = part.CreateNewElement("Element3D15N", 1, [i + 1 for i in order], part.CreateNewProperties(1))
    return element.GetGeometry().DomainSize()


vtk, wedge = list(range(20)), list(range(15))
exchanged = vtk[:12] + vtk[16:] + vtk[12:16]
wedge_exchanged = wedge[:9] + wedge[12:] + wedge[9:12]
values = volume(vtk), volume(exchanged), wedge_volume(wedge), wedge_volume(wedge_exchanged)
print("volume by Kratos 10.4.4   node order of VTK, CalculiX   middle nodes of upright and upper edges exchanged")
print(f"  brick of 3 mm3          {values[0]:8.4f}                      {values[1]:8.4f}   (through meshio 5.3.5)")
print(f"  wedge of 0.5 mm3        {values[2]:8.4f}                      {values[3]:8.4f}")
seen = np.allclose(values, (-0.73333, 3, 0.00093, 0.5), atol=2e-4)
print("as described" if seen else "CHANGED: other volumes")
sys.exit(not seen)
END
venv/bin/python order.py > log 2>&1 || { cat log; exit 1; }
grep -A3 "^volume by Kratos" log
