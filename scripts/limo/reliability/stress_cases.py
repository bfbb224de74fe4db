"""The cases of a stress test: Latin hypercubes over boxes of parameters, and their corners.

N_p is even: half of the pouches are on each face, and the layouts are symmetric about x = 0. Numbers that the device lists no
seams for take those of ``geometry.seam_fractions``.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from limo.cases.case import Case
from limo.config.project import Project
from limo.schema.device import Device
from limo.schema.reliability import BOX_AXES, Box

LOGARITHMIC = ("stiffness_ratio", "thickness", "modulus_factor")
#: generators of the 2^(7-3) design: the axes behind the first four as products of three of those
GENERATORS = ((0, 1, 2), (1, 2, 3), (0, 2, 3))
DIGITS = 4  # significant digits of sampled values: names stay short


def corners() -> np.ndarray:
    """16 corners (16, 7) of the unit cube, no two main effects confounded with each other or with a pair."""
    base = np.array(list(product((0, 1), repeat=4)))
    signs = 2 * base - 1
    rest = [(signs[:, list(g)].prod(axis=1) + 1) // 2 for g in GENERATORS]
    return np.column_stack([base, *rest])


def sample(box: Box, seed: int) -> list[dict[str, float]]:
    """The points of a box as values by axis: a Latin hypercube, and behind it the corners where it asks for them."""
    from scipy.stats import qmc  # takes longer to import than all the rest of planning

    unit = qmc.LatinHypercube(len(BOX_AXES), seed=seed).random(box.samples)
    return [_values(box, point) for point in (np.vstack([unit, corners()]) if box.corners else unit)]


def _values(box: Box, point: np.ndarray) -> dict[str, float]:
    values: dict[str, float] = {}
    for name, share in zip(BOX_AXES, point, strict=True):
        low, high = getattr(box, name)
        if name == "n_pouches":
            values[name] = min(low + 2 * int(share * ((high - low) // 2 + 1)), high)
            continue
        value = low * (high / low) ** share if name in LOGARITHMIC else low + (high - low) * share
        values[name] = float(f"{value:.{DIGITS}g}")
    return values


def varied(device: Device, thickness: float, modulus_factor: float, width_scale: float) -> Device:
    """A device of the same pattern from a fabric of another thickness (mm) and modulus, of the same density."""
    old = device.material
    material = old.model_copy(
        update={
            "thickness": thickness,
            "youngs_modulus": old.youngs_modulus * modulus_factor,
            "areal_density": old.areal_density * thickness / old.thickness,
        }
    )
    return Device(pattern=device.pattern.model_copy(update={"width_scale": width_scale}), material=material)


def stress_cases(loaded: Project) -> dict[tuple[str, int, str], Case]:
    """The cases of the configuration's stress test by box, number in it, and engine; none where there is no such test."""
    test = loaded.config.stress_test
    if test is None:
        return {}
    device, name = loaded.devices[test.device], test.numerics or loaded.default().numerics
    cases = {}
    for box, ranges in test.boxes.items():
        for k, values in enumerate(sample(ranges, test.seed)):
            p_v = values["ventricular_pressure"]
            first = Case(
                device=varied(device, values["thickness"], values["modulus_factor"], values["width_scale"]),
                device_name=test.device,
                n_pouches=int(values["n_pouches"]),
                ventricular_pressure=p_v,
                actuation_pressure_max=round(p_v + test.actuation_above, 6),
                aspect_ratio=values["aspect_ratio"],
                stiffness_ratio=values["stiffness_ratio"],
                mesh=test.mesh,
                mesh_level=loaded.config.mesh_levels[test.mesh.level],
                numerics=loaded.config.numerics_presets[name],
                numerics_name=name,
                frames=tuple(
                    sorted({round(f, 6) for f in (0.0, p_v, p_v + test.actuation_above / 2, p_v + test.actuation_above)})
                ),
            )
            for engine in test.engines:
                numerics = first.numerics.for_engine(engine)
                build = loaded.builds.get(engine, "")
                cases[box, k, engine] = replace(first, engine=engine, build=build, numerics=numerics)
    return cases
