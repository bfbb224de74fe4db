"""An earlier build of this project beside today's: both solve the same devices, and rows go into docs/data/before.csv.

    PYTHONPATH=scripts .venv/bin/python scripts/peer/before.py ../earlier [--only 8] [--settings bricks standard]

The earlier checkout is set up (``make setup``) and has its own configuration, engine and packages. What is solved stays in the
folder and is not solved again. Two cases run at a time, on one thread each. CPU time is that of a case and of the states of
coarser meshes that it begins at.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
import yaml

from limo.measure.ramp import ramp_of
from limo.reports.before import ABOVE, COLUMNS, EARLIER, EARLIERS, KEYS, SETTINGS, read_before
from limo.store.files import read_json, write_json, write_whole
from limo.store.machine import processor

ROOT = Path(__file__).parents[2]
#: P_a,max (kPa) by P_v
LARGEST = {3.8: 60, 13.8: 100, 23.8: 140}
#: by which commit and machine a case was solved, beside it
BY = "by.json"
POUCHES = (4, 6, 8, 10)
#: the devices of the measured errors, which come first
MEASURED = ((4, 13.8), (8, 3.8))
DEVICES = sorted(((n, p) for n in POUCHES for p in LARGEST), key=lambda d: d not in MEASURED)


def study(setting: str, n_pouches: int, ventricular: float, branches: int = 1) -> dict:
    """The study of one case, of so many solutions; an earlier build knows no other keys than these, and one device."""
    one = {
        "description": "one case of two builds",
        "axes": {"n_pouches": [n_pouches], "ventricular_pressure": [ventricular]},
        "actuation_pressure_max": LARGEST[ventricular],
        "outputs": ["volumes"],
        "branches": branches,
        "reuse": "exact",  # other studies of the configuration may go further
    }
    return one | (EARLIERS[setting].study if setting in EARLIERS else {"device": "limo_2025"} | SETTINGS[setting].study)


def solve(checkout: Path, folder: Path, setting: str, n_pouches: int, ventricular: float, branches: int) -> None:
    """One case of so many solutions in a folder of its own, by the workflow of a checkout; only those that are not there."""
    if folder.joinpath(BY).exists() and len(found(folder)) >= branches:
        return
    if not folder.joinpath(BY).exists():
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(checkout / "config", folder / "config")
    file = folder / "config/studies/pair.yaml"
    file.write_text(yaml.safe_dump(study(setting, n_pouches, ventricular, branches)))
    command = [
        *(checkout / ".venv/bin/snakemake", "pair", "--cores", "1", "--quiet", "all"),
        *("--snakefile", checkout / "Snakefile", "--directory", folder),
        *("--config", f"file={folder / 'config/config.yaml'}"),
    ]
    own = {"PYTHONPATH": str(checkout / "scripts"), "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    done = subprocess.run(command, cwd=checkout, env=os.environ | own, capture_output=True, text=True, check=False)
    if done.returncode or len(found(folder)) < branches:
        raise SystemExit(f"{' '.join(map(str, command))} failed: {(done.stdout + done.stderr)[-2000:]}")
    git = ["git", "rev-parse", "--short=7", "HEAD"]
    commit = subprocess.run(git, cwd=checkout, capture_output=True, text=True, check=True).stdout.strip()
    write_json(folder / BY, {"commit": commit, "machine": processor()})


def found(folder: Path) -> list[Path]:
    """Folders of solved cases that had a ramp, which states of coarser meshes have not, the flat state as it is first."""
    solved = [f.parent for f in folder.glob("results/cases/*/volumes.nc") if f.parent.joinpath("status.json").exists()]
    ramps = [f for f in solved if read_json(f / "status.json")["iterations_by_stage"]["ramp"] > 0]
    return sorted(ramps, key=lambda f: read_json(f / "case.json")["case"]["branch"])


def row(case: Path, folder: Path, setting: str, n_pouches: int, ventricular: float) -> tuple[dict, xr.Dataset]:
    """What one case cost and where it ended, and its ramp."""
    status = read_json(case / "status.json")
    with xr.open_dataset(case / "volumes.nc") as history:
        ramp = ramp_of(history.load())
    end, stages = ramp.isel(increment=-1), status["iterations_by_stage"]
    work = ventricular * end.ventricle_volume_conjugate + end.actuation_pressure * end.actuation_volume_conjugate
    return {
        "n_pouches": n_pouches,
        "ventricular_pressure": ventricular,
        "setting": setting,
        "status": status["status"],
        "iterations": sum(stages.values()),
        "iterations_ramp": stages["ramp"],
        "factorisations": status.get("factorisations"),
        "cpu_seconds": round(status.get("fit_cpu_seconds", 0.0) + status["solver_cpu_seconds"], 1),
        "memory_mib": round(status["solver_memory_mib"]),
        "iteration_ratio": _ratio(status),
        "rest_volume": round(float(ramp.ventricle_volume[0]), 2),
        "stroke": round(float(ramp.ventricle_volume[0] - end.ventricle_volume), 2),
        "energy_mj": round(float(end.strain_energy - work), 3),
    } | read_json(folder / BY), ramp


def _ratio(status: dict) -> float | None:
    """CPU time of iterations over that of their factorisations and solutions; None after several attempts, which share it."""
    if len(status["attempts"]) > 1:
        return None
    return round((status["solver_cpu_seconds"] - status.get("setup_seconds", 0.0)) / status["factor_seconds"], 3)


def scatter(checkout: Path, n_pouches: int, ventricular: float) -> float | None:
    """How far the two branches that the earlier build keeps of a device are from each other, as ``apart``; None for none."""
    kept = checkout / "docs/gallery/standard/data/afterload.nc"
    if not kept.exists():
        return None
    with xr.open_dataset(kept) as dataset:
        device = dataset.sel(n_pouches=n_pouches, ventricular_pressure=ventricular).squeeze().load()
    ramps = [device.isel(branch=k).dropna("actuation_pressure", subset=["ventricle_volume"]) for k in (0, 1)]
    return apart(*(r.assign_coords(increment=r.actuation_pressure) for r in ramps), ventricular)


def error(checkout: Path, ramp: xr.Dataset, n_pouches: int, ventricular: float) -> float | None:
    """Relative L2 distance of V_v over the ramp from the mean of the finest runs that the earlier build keeps; None for none."""
    kept = checkout / f"docs/gallery/data/reference_np{n_pouches}_runs.nc"
    if (n_pouches, ventricular) not in MEASURED or not kept.exists():
        return None
    with xr.open_dataset(kept) as runs:
        mean = runs.ventricle_volume.mean("run").dropna("actuation_pressure").load()
    ours = np.interp(mean.actuation_pressure, ramp.actuation_pressure.values, ramp.ventricle_volume.values)
    return round(float(np.linalg.norm(ours - mean) / np.linalg.norm(mean)), 6)


def apart(ramp: xr.Dataset, other: xr.Dataset, ventricular: float) -> float:
    """Relative L2 distance of V_v of two ramps from P_v + ``ABOVE`` on, at the pressures of the second."""
    at = other.actuation_pressure.values
    at = at[at >= ventricular + ABOVE]
    ours, theirs = (np.interp(at, r.actuation_pressure.values, r.ventricle_volume.values) for r in (ramp, other))
    return round(float(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs)), 6)


def main() -> None:
    """Solve what lacks, and put the rows in place of earlier ones of the same cases."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("earlier", type=Path, help="the earlier checkout")
    parser.add_argument("--only", type=int, choices=POUCHES, help="devices of this number of pouches alone")
    parser.add_argument("--first", type=int, default=len(DEVICES), help="so many devices (default: all)")
    parser.add_argument("--settings", nargs="+", choices=SETTINGS, default=[*SETTINGS], help="those of today (default: all)")
    parser.add_argument(
        "--branches",
        type=int,
        default=1,
        choices=(1, 2),
        help="solutions of the earlier build's `standard`, 2: for their scatter",
    )
    parser.add_argument("--folder", type=Path, default=ROOT / ".local/before", help="where cases are solved and kept")
    parser.add_argument("--keep", type=Path, default=ROOT / "docs/data/before.csv", help="the table of rows")
    chosen = parser.parse_args()
    earlier, folder = chosen.earlier.resolve(), chosen.folder.resolve()
    devices = [d for d in DEVICES[: chosen.first] if chosen.only in (None, d[0])]
    settings = list(dict.fromkeys(name for setting in chosen.settings for name in (SETTINGS[setting].beside, setting)))
    jobs = [(s, *d) for d in devices for s in settings]
    places = {job: folder / "_".join(map(str, job)) for job in jobs}

    def run(job: tuple[str, int, float]) -> None:
        solve(earlier if job[0] in EARLIERS else ROOT, places[job], *job, chosen.branches if job[0] == EARLIER else 1)
        print(*job, flush=True)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(run, jobs))
    rows = []
    for device in devices:
        several = {s: [row(case, places[s, *device], s, *device) for case in found(places[s, *device])] for s in settings}
        solved = {s: solutions[0] for s, solutions in several.items()}
        for setting, (one, ramp) in solved.items():
            _, reference = solved[setting if setting in EARLIERS else SETTINGS[setting].beside]
            known = {"scatter": scatter(earlier, *device)} if setting == EARLIER else {}
            if len(several[setting]) > 1:
                (_, _), (second, other) = several[setting][:2]
                known = {"scatter": apart(ramp, other, device[1]), "energy_scatter": abs(one["energy_mj"] - second["energy_mj"])}
            off = {"error": error(earlier, ramp, *device)}
            rows.append(one | known | off | {"apart": apart(ramp, reference, device[1])})
    kept, measured = read_before(chosen.keep), pd.DataFrame(rows, columns=COLUMNS)
    table = pd.concat([kept, measured]).drop_duplicates(KEYS, keep="last") if len(kept) else measured
    write_whole(chosen.keep, lambda path: table.to_csv(path, index=False))


if __name__ == "__main__":
    main()
