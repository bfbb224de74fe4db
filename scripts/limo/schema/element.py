"""The elements that a mesh may be made of, as plain data, by the names that files and CalculiX's decks have for them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Element:
    """One element type of the fabric layer.

    ``is_shell``: CalculiX makes the layer of it itself, the other ones are written out as bricks. ``corners`` (3 or 4) and
    ``order`` (1: corners alone, 2: mid-sides as well) are those of its face. ``gauss_points``: points a direction of the brick,
    written out or made of a shell; of triangles points across the thickness. ``plane_stress``: a shell of the project's own, with
    the nodes of a written-out brick (``limo.mechanics.shell``).
    """

    name: str
    is_shell: bool
    corners: int
    order: int
    gauss_points: int
    plane_stress: bool = False

    @property
    def face_nodes(self) -> int:
        """Nodes of its face."""
        return self.order * self.corners


#: CalculiX makes C3D6 of S3, C3D8I of S4, C3D8R of S4R, C3D15 of S6, C3D20 of S8 and C3D20R of S8R
ELEMENTS = {
    element.name: element
    for element in (
        Element("S3", is_shell=True, corners=3, order=1, gauss_points=2),
        Element("S4", is_shell=True, corners=4, order=1, gauss_points=2),
        Element("S4R", is_shell=True, corners=4, order=1, gauss_points=1),
        Element("S6", is_shell=True, corners=3, order=2, gauss_points=3),
        Element("S8", is_shell=True, corners=4, order=2, gauss_points=3),
        Element("S8R", is_shell=True, corners=4, order=2, gauss_points=2),
        Element("C3D20", is_shell=False, corners=4, order=2, gauss_points=3),
        Element("C3D20R", is_shell=False, corners=4, order=2, gauss_points=2),
        Element("SHELL8R", is_shell=False, corners=4, order=2, gauss_points=2, plane_stress=True),
    )
}


def element(name: str) -> Element:
    """The element of a name. Raises ``KeyError`` for a name that is none."""
    return ELEMENTS[name]
