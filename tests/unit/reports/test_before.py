"""An earlier build beside today's: settings that a study can name, and what is made of kept rows. No earlier build is needed."""

import importlib.util
import math

import numpy as np
import pandas as pd
import pytest
import xarray as xr
import yaml

from limo.cases.grid import study_cases
from limo.config.load import load_config
from limo.errors import ResultError
from limo.reports.before import (
    COLUMNS,
    EARLIER,
    EARLIER_PAPER,
    SETTINGS,
    accurate,
    before_section,
    no_higher,
    read_before,
    share,
    times_less,
    within_scatter,
)
from tests.helpers.cases import without_studies


@pytest.fixture(scope="module")
def script(root):
    """The script that measures, which is no part of the package."""
    spec = importlib.util.spec_from_file_location("before_script", root / "scripts/peer/before.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("setting", SETTINGS)
def test_each_setting_is_a_study_of_one_case(root, tmp_path, script, setting):
    studies = without_studies(root, tmp_path)
    (studies / "pair.yaml").write_text(yaml.safe_dump(script.study(setting, 8, 3.8)))
    path = tmp_path / "config/config.yaml"
    path.write_text(yaml.safe_dump(yaml.safe_load(path.read_text()) | {"studies": ["pair"]}))
    loaded = load_config(path)
    (case,) = study_cases(loaded, "pair").values()
    assert case.device == loaded.devices["limo_2025"]
    assert (case.n_pouches, case.engine, case.mesh.symmetry) == (8, "newton", "quarter")
    assert case.mesh.element == ("C3D20R" if setting.startswith(("bricks", "preview")) else "SHELL8R")
    levels = {"shells_coarse": "coarse", "bricks_paper": "paper", "shells_paper": "paper", "preview": "preview"}
    assert case.mesh.level == levels.get(setting, "medium")
    assert case.numerics.contact.endo_epi == (setting == "standard")
    assert bool(case.numerics.newton.fit_on) == (setting not in ("bricks_flat", "preview"))
    assert case.actuation_pressure_max == 60


def test_the_devices_of_the_measured_errors_come_first(script):
    assert len(script.DEVICES) == 12
    assert set(script.DEVICES[:2]) == {(4, 13.8), (8, 3.8)}


def rows(bricks: float, energy: float) -> pd.DataFrame:
    earlier = dict.fromkeys(COLUMNS, 1) | {"n_pouches": 8, "ventricular_pressure": 3.8, "setting": EARLIER, "commit": "7cdfcb9"}
    earlier |= {"cpu_seconds": 1000.0, "energy_mj": -100.0, "apart": 0.0, "machine": "a machine", "energy_scatter": float("nan")}
    ours = earlier | {"setting": "bricks", "commit": "today", "cpu_seconds": bricks, "energy_mj": energy, "apart": 0.012}
    return pd.DataFrame([earlier, ours], columns=COLUMNS)


@pytest.mark.parametrize(("cpu", "energy", "less", "lower"), [(250.0, -101.0, "4.0", "1 of 1"), (800.0, -99.0, "1.2", "0 of 1")])
def test_a_setting_is_compared_with_the_earlier_build(cpu, energy, less, lower):
    text = "\n".join(before_section(rows(cpu, energy)))
    line = next(line for line in text.splitlines() if SETTINGS["bricks"].words in line)
    assert [c.strip() for c in line.split("|")[3:6]] == [less] * 3
    assert f"| {lower} |" in line
    assert "| 1.2% |" in line
    assert "`7cdfcb9`" in text
    assert times_less(rows(cpu, energy), "bricks").to_dict() == {(8, 3.8): pytest.approx(1000.0 / cpu)}
    assert times_less(rows(cpu, energy), "shells").empty


@pytest.mark.parametrize(("scatter", "within"), [(0.02, True), (0.01, False)])
def test_curves_are_judged_by_the_scatter_of_branches_and_energies_by_the_earlier_ones(scatter, within):
    for energy, low in ((-101.0, True), (-99.95, True), (-99.0, False)):
        pair = rows(500.0, energy)
        pair["scatter"] = pair["scatter"].where(pair.setting != EARLIER, scatter).where(pair.setting == EARLIER)
        assert within_scatter(pair, "bricks").tolist() == [within]
        assert no_higher(pair, "bricks").tolist() == [low]
        assert f"| {int(within)} of 1 | {int(low)} of 1 |" in "\n".join(before_section(pair))
    assert within_scatter(pair.assign(scatter=float("nan")), "bricks").empty
    near = rows(500.0, -99.0)
    for apart, low in ((0.9, False), (1.1, True)):
        near["energy_scatter"] = near.setting.map({EARLIER: apart})
        assert no_higher(near, "bricks").tolist() == [low], "as near as two branches of the earlier build"


def test_the_cheapest_setting_that_is_accurate_enough_counts():
    def one(setting: str, pouches: int, seconds: float, error: float) -> dict:
        changes = {
            "setting": setting,
            "n_pouches": pouches,
            "cpu_seconds": seconds,
            "error": error,
            "commit": "a",
            "machine": "b",
        }
        return dict.fromkeys(COLUMNS, 1) | changes

    table = pd.DataFrame([
        one(EARLIER, 4, 800.0, 0.01), one("shells", 4, 200.0, 0.019), one("shells_coarse", 4, 50.0, 0.021),
        one(EARLIER, 8, 700.0, 0.01), one("shells", 8, 140.0, 0.01), one("shells_coarse", 8, 35.0, 0.02),
        one(EARLIER, 10, 700.0, float("nan")), one("shells", 10, 7.0, float("nan")),
    ])  # fmt: skip
    assert accurate(table).to_dict() == {(4, 1): 4.0, (8, 1): 20.0}
    assert math.isnan(accurate(table[table.setting != "shells"])[4, 1]), "nothing of this device is near enough"
    assert "| 2.1% |" in "\n".join(before_section(table))


def test_errors_are_those_from_the_finest_runs_that_the_checkout_keeps(script, tmp_path):
    pressure = np.arange(0.0, 61.0)
    ramp = xr.Dataset({"ventricle_volume": ("increment", 303.0 - pressure)}, {"actuation_pressure": ("increment", pressure)})
    assert script.error(tmp_path, ramp, 8, 3.8) is None
    file = tmp_path / "docs/gallery/data/reference_np8_runs.nc"
    file.parent.mkdir(parents=True)
    volume = np.stack([299.0 - pressure, 301.0 - pressure])
    xr.Dataset({"ventricle_volume": (("run", "actuation_pressure"), volume)}, {"actuation_pressure": pressure}).to_netcdf(file)
    assert script.error(tmp_path, ramp, 8, 3.8) == pytest.approx(3.0 * 61**0.5 / np.linalg.norm(300.0 - pressure), abs=1e-6)
    assert script.error(tmp_path, ramp, 8, 13.8) is None, "nothing is kept of it"


def test_the_scatter_is_that_of_the_branches_which_the_checkout_keeps(script, tmp_path):
    assert script.scatter(tmp_path, 8, 3.8) is None
    file = tmp_path / "docs/gallery/standard/data/afterload.nc"
    file.parent.mkdir(parents=True)
    pressure = np.arange(0.0, 61.0)
    volume = np.stack([300.0 - pressure, np.where(pressure > 13.8, 1.01, 1.5) * (300.0 - pressure)])
    dims = ("n_pouches", "ventricular_pressure", "branch", "actuation_pressure")
    xr.Dataset({"ventricle_volume": (dims, volume[None, None])}, {
        "n_pouches": [8], "ventricular_pressure": [3.8], "branch": [0, 1], "actuation_pressure": pressure,
    }).to_netcdf(file)  # fmt: skip
    assert script.scatter(tmp_path, 8, 3.8) == pytest.approx(0.01 / 1.01, rel=1e-4), "from P_v + 10 kPa on"


def test_a_setting_is_beside_the_one_of_its_own_density():
    own = {"bricks": "bricks_paper", EARLIER: EARLIER_PAPER}
    finer = rows(100.0, -100.0).replace({"setting": own})
    both = pd.concat([rows(500.0, -100.0), finer], ignore_index=True)
    assert times_less(both, "bricks_paper").tolist() == [10.0]
    assert times_less(both, "bricks").tolist() == [2.0]
    more = finer[finer.setting == EARLIER_PAPER].assign(n_pouches=4)
    assert share(pd.concat([both, more]), "bricks_paper") == pytest.approx(0.1), "of the devices that both solved"
    assert math.isnan(share(both, "shells"))
    text = "\n".join(before_section(both))
    assert text.count("Beside ") == 2
    assert "bricks_paper" in text.split("Beside ")[2]
    assert "bricks_paper" not in text.split("Beside ")[1]


def test_a_gap_says_how_it_is_filled_and_another_table_is_refused(tmp_path):
    assert "scripts/peer/before.py" in before_section(read_before(tmp_path / "no.csv"))[0]
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ResultError, match="no columns n_pouches"):
        read_before(tmp_path / "other.csv")
