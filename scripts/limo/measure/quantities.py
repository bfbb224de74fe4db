"""What is measured of a solved case: name, place, units and long name of each quantity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from limo.measure.buckling import MOST_EVENTS
from limo.measure.strain import DEVICE_SIDES
from limo.measure.zones import ZONES


@dataclass(frozen=True)
class Measure:
    """What is stored under a name: ``per`` lists its dimensions besides those of a case; ``output`` asks for it.

    An empty ``output`` comes with any of them; ``CYCLE`` is part of fatigue where cases go through a cycle.
    """

    per: tuple[str, ...]
    units: str
    long_name: str
    output: str = ""


CYCLE = "cycle"


_TOP = "area average of the top 5 %"


MEASURES = {
    "frame_pressure": Measure(("frame",), "kPa", "actuation pressure of the increment nearest to a frame, P_a"),
    "von_mises_peak": Measure(("frame",), "MPa", f"von Mises stress, largest through the thickness, {_TOP}", "stress"),
    "von_mises_peak_middle": Measure(("frame",), "MPa", f"von Mises stress on the middle surface, {_TOP}", "stress"),
    "von_mises_max": Measure(("frame",), "MPa", "largest von Mises stress", "stress"),
    "von_mises_p99": Measure(("frame",), "MPa", "von Mises stress not exceeded on 99 % of the area", "stress"),
    "von_mises_peak_share": Measure(("frame", "zone"), "1", "share of the top 5 % of the area in a zone", "stress"),
    "zone_share": Measure(("zone",), "1", "share of the area of the fabric in a zone", "stress"),
    "von_mises_max_x": Measure(("frame",), "mm", "where the largest von Mises stress is on the flat pattern, x", "stress"),
    "von_mises_max_y": Measure(("frame",), "mm", "where the largest von Mises stress is on the flat pattern, y", "stress"),
    "von_mises_max_zone": Measure(("frame",), "", "zone of the largest von Mises stress", "stress"),
    "von_mises_max_surface": Measure(("frame",), "", "surface of the largest von Mises stress", "stress"),
    "residual": Measure(("frame",), "1", "force resultants out of equilibrium over the applied load", "stress"),
    "residual_floor": Measure(("frame",), "1", "part of the residual that rounding of the frame explains", "stress"),
    "residual_full": Measure(("frame",), "1", "nodal forces out of equilibrium over the applied load", "stress"),
    "residual_full_floor": Measure(("frame",), "1", "part of the full residual that rounding of the frame explains", "stress"),
    "viscous_share": Measure(("frame",), "1", "damping and inertia over the applied load", "stress"),
    "strain_peak": Measure(("frame", "side"), "1", f"largest principal strain in the fabric's plane, E_1, {_TOP}", "strain"),
    "strain_max": Measure(("frame", "side"), "1", "largest principal strain in the fabric's plane, E_1, its maximum", "strain"),
    "strain_p99": Measure(("frame", "side"), "1", "E_1 not exceeded on 99 % of the area", "strain"),
    "direction_around": Measure(
        ("frame", "side"), "1", "share of the pouch area where v_1 is nearer to the circumference than to the axis", "strain"
    ),
    "direction_angle": Measure(("frame", "side"), "degree", "median angle of v_1 to the circumference, on pouches", "strain"),
    "direction_between": Measure(("frame",), "degree", "median angle between v_1 of the two surfaces, on pouches", "strain"),
    "direction_between_at_seams": Measure(("frame",), "degree", "the same, near seams only", "strain"),
    "direction_to_warp": Measure(
        ("frame", "side"), "degree", "median angle of v_1 to the warp of woven fabric, over a surface", "strain"
    ),
    "fibre_aligned_share": Measure(
        ("frame",), "1", "share of the square of membrane stress of woven fabric that warp and weft bear, over the area", "strain"
    ),
    "fatigue_amplitude_peak": Measure(
        (), "1", f"largest principal membrane strain of the inflation near seams, {_TOP}", "fatigue"
    ),
    "fatigue_cycles_min": Measure((), "1", "smallest number of cycles to failure near seams, N_f", "fatigue"),
    "fatigue_cycles_p05": Measure((), "1", "N_f that 5 % of the area near seams do not reach", "fatigue"),
    "fatigue_endurance_share": Measure((), "1", "share of the area near seams below the endurance range", "fatigue"),
    "cycle_amplitude_peak": Measure((), "1", f"strain amplitude of the last closed cycle near seams, {_TOP}", CYCLE),
    "cycle_mean_peak": Measure((), "1", f"mean strain of the last closed cycle near seams, {_TOP}", CYCLE),
    "cycle_fatigue_cycles_min": Measure((), "1", "smallest number of such cycles to failure near seams, N_f", CYCLE),
    "cycle_fatigue_cycles_p05": Measure((), "1", "such N_f that 5 % of the area near seams do not reach", CYCLE),
    "cycle_fatigue_endurance_share": Measure((), "1", "share of the area near seams below the endurance range", CYCLE),
    "buckling_before": Measure(("event",), "kPa", "last actuation pressure before a buckling event, P_a,c-"),
    "buckling_after": Measure(("event",), "kPa", "first actuation pressure after a buckling event, P_a,c+"),
    "buckling_jump": Measure(("event",), "ml", "jump of the stroke volume in a buckling event"),
    "buckling_displacement": Measure(("event",), "1", "largest displacement difference across an event, over the length"),
    "contact_front_back_clear": Measure((), "kPa", "highest P_a of a frame before front and back would touch"),
    "contact_front_back": Measure((), "kPa", "lowest P_a of a frame in which front and back would touch"),
    "contact_endo_epi_clear": Measure((), "kPa", "highest P_a of a frame before endocardium and epicardium pass each other"),
    "contact_endo_epi": Measure((), "kPa", "lowest P_a of a frame in which endocardium and epicardium have passed each other"),
    "contact_outer_clear": Measure((), "kPa", "highest P_a of a frame before outer surfaces cross"),
    "contact_outer": Measure((), "kPa", "lowest P_a of a frame in which outer surfaces cross: pouches, or folds of the wall"),
}


def chosen_measures(outputs: Sequence[str], is_cycled: bool) -> dict[str, Measure]:
    """The measures that come with outputs, of cases that go through a cycle or do not."""
    asked = {"", *outputs} | ({CYCLE} if is_cycled and "fatigue" in outputs else set())
    return {name: measure for name, measure in MEASURES.items() if measure.output in asked}


FRAME = "pressure of a frame as the study writes it, in kPa where it is a number"


SIDE = {"long_name": "side of the device's wall, endocardial towards the ventricle"}


LABELS = {
    "zone": ("zone", list(ZONES), {"long_name": "zone of the fabric"}),
    "side": ("side", list(DEVICE_SIDES), SIDE),
    "event": ("event", list(range(MOST_EVENTS)), {"long_name": "buckling event, from 0 in rising order of P_a"}),
}
