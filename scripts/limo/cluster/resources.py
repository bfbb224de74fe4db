"""What a job asks a cluster for: memory in MiB and time in whole minutes, from the costs that ``limo check`` predicts.

A job that ended for lack of either is started again and then asks for twice as much. On one machine nobody counts these.
"""

from __future__ import annotations

import math

from limo.cases.case import Case
from limo.cases.cost import PART, memory_mib

#: longest time and largest memory of a solve over those predicted, in the measurements that the documents are made of
TIME_MARGIN, MEMORY_MARGIN = 2.2, 1.3
#: MiB of the Snakemake that a job is beside its script, and minutes until its script begins on a busy cluster
SNAKEMAKE_MIB, START_MINUTES = 300, 2
#: factor of time and memory with each further attempt
MORE = 2
#: attempts at a job; the profiles of clusters repeat it
ATTEMPTS = 3
#: MiB and minutes that scripts may take whatever the study is
SCRIPTS: dict[str, tuple[int, int]] = {
    "mesh_device": (250, 3),
    "export_study": (500, 5),
    "gather_airbag": (500, 5),
    "draw_airbag": (500, 10),
    "keep_airbags": (300, 5),
    "keep_runs": (1500, 30),
    "gather_accuracy": (2000, 30),
    "draw_accuracy": (1000, 10),
    "draw_figure": (1500, 30),
    "fit_material": (500, 5),
    "check_paper": (1000, 10),
    "propose_designs": (2000, 10),
    "tell_designs": (1000, 20),
    "report_exploration": (2000, 20),
    "page": (2000, 30),
    "stress_test": (2000, 60),
    # as long and as large as the largest that there is
    "solve_airbag": (4000, 480),
    "measure_scaling": (16000, 480),
}
#: MiB and minutes of what is gathered from many cases, and MiB and seconds of each of them
GATHERED: dict[str, tuple[int, int, float, float]] = {
    "gather_study": (500, 5, 1.0, 0.3),
    "gather_shapes": (1000, 5, 5.0, 3.0),
}
#: MiB and minutes of what is computed of one solved case, and MiB of each thousand displacements of the part that is solved
OF_A_CASE: dict[str, tuple[int, int, float]] = {
    "measure_case": (250, 10, 8.0),
    "write_fields": (250, 10, 8.0),
}


def solve_memory(case: Case, attempt: int = 1) -> int:
    """MiB of a job that solves a case."""
    return math.ceil(SNAKEMAKE_MIB + MEMORY_MARGIN * memory_mib(case) * MORE ** (attempt - 1))


def solve_minutes(seconds: float, attempt: int = 1) -> int:
    """Minutes of a job that solves a case of which ``seconds`` of CPU time are predicted."""
    return math.ceil(START_MINUTES + TIME_MARGIN * seconds / 60 * MORE ** (attempt - 1))


def script_memory(rule: str, attempt: int = 1, case: Case | None = None, count: int = 0) -> int:
    """MiB of another rule's job, of one ``case`` or gathered from ``count`` cases. Raises ``KeyError`` for a rule without."""
    if rule in OF_A_CASE:
        fixed, _, growth = OF_A_CASE[rule]
        needed = fixed + growth * case.mesh_level.degrees_of_freedom * PART[case.mesh.symmetry] / 1000
    elif rule in GATHERED:
        fixed, _, growth, _ = GATHERED[rule]
        needed = fixed + growth * count
    else:
        needed = SCRIPTS[rule][0]
    return math.ceil(SNAKEMAKE_MIB + needed * MORE ** (attempt - 1))


def script_minutes(rule: str, attempt: int = 1, count: int = 0) -> int:
    """Minutes of the same."""
    if rule in GATHERED:
        _, fixed, _, growth = GATHERED[rule]
        needed = fixed + growth * count / 60
    else:
        needed = (OF_A_CASE.get(rule) or SCRIPTS[rule])[1]
    return math.ceil(START_MINUTES + needed * MORE ** (attempt - 1))


def core_hours(minutes: float, threads: int) -> float:
    """Core hours of a job of some minutes."""
    return minutes * threads / 60
