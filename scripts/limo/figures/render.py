"""Pictures of surfaces, rendered off screen without a display: one camera, one light and one scale of length for all figures."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from functools import cache

import matplotlib
import numpy as np

from limo.errors import LimoError
from limo.figures.renderer import renderer_lacks
from limo.mesh.surface import Facets

BORDER, PLAIN, UNKNOWN, LINE_WIDTH = "#202020", "#d5dbe0", "#c4c4c4", 2.4
NEARER = 0.6  # mm by which lines are drawn nearer than the surface they lie on, so that it does not swallow them
SAMPLES = 2  # pixels rendered along a side of one in the picture, whose mean it is
#: azimuth and elevation in degrees as the camera sees them, and intensity
LIGHTS = ((-30, 40, 0.6), (40, 15, 0.25), (0, 0, 0.25))
_UP = np.array([0.0, -1.0, 0.0])  # the valve is on top


@dataclass(frozen=True)
class Camera:
    """Where one looks from: degrees to the side and from above, mm of the device's height and width that the picture shows."""

    azimuth: float = 15.0
    elevation: float = 22.0
    height: float = 170.0
    width: float = 130.0
    centre: tuple[float, float, float] = (0.0, 68.0, 0.0)
    back: bool = False

    def scaled(self, factor: float) -> Camera:
        """The same view of a device ``factor`` times as long."""
        centre = tuple(factor * c for c in self.centre)
        return replace(self, height=factor * self.height, width=factor * self.width, centre=centre)


@dataclass(frozen=True)
class Scale:
    """How values become colours: a matplotlib map between two values, in steps where ``levels`` says how many."""

    cmap: str
    low: float
    high: float
    log: bool = False
    levels: int | None = None

    @property
    def norm(self) -> matplotlib.colors.Normalize:
        """The same for matplotlib's colour bars; what lies beyond an end has the colour of the end."""
        kind = matplotlib.colors.LogNorm if self.log else matplotlib.colors.Normalize
        return kind(self.low, self.high, clip=True)

    @property
    def map(self) -> matplotlib.colors.Colormap:
        """The map, in steps where there are levels."""
        return matplotlib.colormaps[self.cmap].resampled(self.levels) if self.levels else matplotlib.colormaps[self.cmap]

    def colours(self, values: np.ndarray) -> np.ndarray:
        """Colours (n, 3) of 8 bits; what is no number is grey."""
        known = np.isfinite(values)
        shown = self.map(np.asarray(self.norm(np.where(known, values, self.low))))[:, :3]
        shown[~known] = matplotlib.colors.to_rgb(UNKNOWN)
        return np.round(255 * shown).astype(np.uint8)


@dataclass
class Scene:
    """What is drawn in one picture: surfaces with a colour or a map each, and lines."""

    surfaces: list[tuple[Facets, dict]] = field(default_factory=list)
    lines: list[tuple[np.ndarray, dict]] = field(default_factory=list)

    def add(self, facets: Facets, *, color: str | None = None, scale: Scale | None = None) -> Scene:
        """Add a surface, in one ``color`` or with its values by a ``scale``; returns the scene."""
        self.surfaces.append((facets, {"color": color, "scale": scale}))
        return self

    def add_lines(self, points: np.ndarray, values: np.ndarray, number: np.ndarray, scale: Scale) -> Scene:
        """Add lines through ``points`` (v, 3) with ``values`` (v,); neighbours of one ``number`` (v,) are joined."""
        joined = np.flatnonzero((np.diff(number) == 0) & (number[:-1] >= 0))
        self.lines.append((points, {"pairs": np.stack([joined, joined + 1], axis=1), "values": values, "scale": scale}))
        return self


def render(scene: Scene, camera: Camera, pixels: int = 420) -> np.ndarray:
    """The picture (h, w, 3) of a scene on white, ``pixels`` high. Raises ``LimoError`` where nothing can be rendered."""
    pyvista = _pyvista()
    size = (round(pixels * camera.width / camera.height), pixels)
    plotter = _plotter(*(SAMPLES * n for n in size))
    nearer = NEARER * _towards(camera)
    for facets, how in scene.surfaces:
        _add_surface(pyvista, plotter, facets, how, nearer)
    for points, how in scene.lines:
        _add_lines(pyvista, plotter, points, how, 2.0 * nearer)
    _look(plotter, camera)
    plotter.render_window.Render()  # a screenshot alone may be of what was rendered before
    large = plotter.screenshot(return_img=True).astype(np.uint16)
    plotter.clear_actors()
    samples = [large[i::SAMPLES, j::SAMPLES] for i in range(SAMPLES) for j in range(SAMPLES)]
    return ((sum(samples[1:], samples[0]) + SAMPLES**2 // 2) // SAMPLES**2).astype(np.uint8)


@cache
def _plotter(width: int, height: int):
    """A window off screen with the lights of all pictures; it is used again, because opening one takes longer than drawing."""
    plotter = _pyvista().Plotter(off_screen=True, window_size=[width, height], lighting="none")
    plotter.set_background("white")
    plotter.disable_anti_aliasing()
    for azimuth, elevation, intensity in LIGHTS:
        light = _pyvista().Light(light_type="camera light", intensity=intensity)
        light.position = 10.0 * _direction(azimuth, elevation, np.array([0.0, 1.0, 0.0]))
        light.focal_point = (0.0, 0.0, 0.0)
        plotter.add_light(light)
    return plotter


def _pyvista():
    """pyvista, set to render without a display. Raises ``LimoError`` where the system's libraries for that are missing."""
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    if lacking := renderer_lacks():
        raise LimoError(lacking)
    import pyvista

    return pyvista


def _direction(azimuth: float, elevation: float, up: np.ndarray) -> np.ndarray:
    """Unit vector towards the viewer, for a view along -z that is turned about ``up`` and raised."""
    a, e = np.radians([azimuth, elevation])
    side = np.cross(up, [0.0, 0.0, 1.0])
    return np.cos(e) * (np.cos(a) * np.array([0.0, 0.0, 1.0]) + np.sin(a) * side) + np.sin(e) * up


def _towards(camera: Camera) -> np.ndarray:
    towards = _direction(camera.azimuth, camera.elevation, _UP)
    return towards * [1.0, 1.0, -1.0] if camera.back else towards


def _look(plotter, camera: Camera) -> None:
    centre = np.array(camera.centre)
    plotter.camera_position = [tuple(centre + 1000.0 * _towards(camera)), tuple(centre), tuple(_UP)]
    view = plotter.camera
    view.parallel_projection = True
    view.parallel_scale = camera.height / 2
    plotter.renderer.ResetCameraClippingRange()


def _add_surface(pyvista, plotter, facets: Facets, how: dict, nearer: np.ndarray) -> None:
    cells = np.column_stack([np.full(len(facets.quads), 4), facets.quads])
    mesh = pyvista.PolyData(facets.points.astype(np.float32), faces=cells)
    mesh.point_data.active_normals = facets.normals.astype(np.float32)
    style = {"smooth_shading": False, "ambient": 0.45, "diffuse": 0.75, "specular": 0.0, "render": False}
    if how["color"] is None:
        mesh["rgb"] = how["scale"].colours(facets.values)
        actor = plotter.add_mesh(mesh, scalars="rgb", rgb=True, **style)
    else:
        actor = plotter.add_mesh(mesh, color=how["color"], **style)
    actor.prop.interpolation = "phong"
    if len(facets.borders):
        pairs = np.column_stack([np.full(len(facets.borders), 2), facets.borders])
        edges = pyvista.PolyData((facets.points + nearer).astype(np.float32), lines=pairs)
        plotter.add_mesh(edges, color=BORDER, line_width=LINE_WIDTH, lighting=False, render=False)


def _add_lines(pyvista, plotter, points: np.ndarray, how: dict, nearer: np.ndarray) -> None:
    pairs = np.column_stack([np.full(len(how["pairs"]), 2), how["pairs"]])
    lines = pyvista.PolyData((points + nearer).astype(np.float32), lines=pairs)
    lines["rgb"] = how["scale"].colours(how["values"])
    plotter.add_mesh(lines, scalars="rgb", rgb=True, line_width=LINE_WIDTH, lighting=False, render=False)
