"""Distances to a surface of triangles, by VTK. A module of its own, so that VTK is loaded when distances are taken."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_ID_TYPE, vtkDoubleArray, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance


def distance_to(points: np.ndarray, triangles: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Distances (p,) of points (p, 3) from ``triangles`` (k, 3) on ``points`` (n, 3), as a function; all in one unit."""
    faces, place = vtkCellArray(), vtkPoints()
    faces.SetData(3, numpy_to_vtk(triangles.ravel(), deep=True, array_type=VTK_ID_TYPE))
    place.SetData(numpy_to_vtk(points, deep=True))
    surface = vtkPolyData()
    surface.SetPoints(place)
    surface.SetPolys(faces)
    measure = vtkImplicitPolyDataDistance()
    measure.SetInput(surface)

    def distances(others: np.ndarray) -> np.ndarray:
        signed = vtkDoubleArray()
        measure.FunctionValue(numpy_to_vtk(others), signed)
        return np.abs(vtk_to_numpy(signed))

    return distances
