"""Rungs of the recovery ladder: what they change, in which stage, and what a configuration may not ask of them."""

from dataclasses import replace

import pytest
import yaml

from limo.cases.grid import study_cases
from limo.config.load import load_config
from limo.config.rungs import check_ladder, multiplied
from limo.errors import ConfigError
from limo.schema.numerics import Mesh, MeshLevel
from limo.schema.solver import Rung
from limo.solve.ladder import climb

LEVEL = MeshLevel(degrees_of_freedom=9000)


@pytest.fixture
def numerics(loaded):
    return loaded.config.numerics_presets["fast"]


@pytest.fixture
def case(loaded):
    return next(iter(study_cases(loaded, "kinematics").values()))


def rung(**factors):
    return Rung(name="a_rung", multiply={k.replace("__", "."): v for k, v in factors.items()})


@pytest.mark.parametrize("stage", ["fit", "hold", "ramp"])
def test_factors_reach_the_stage_that_failed_and_nothing_else(numerics, stage):
    changed = multiplied(numerics, LEVEL, rung(failed__damping=10.0), stage)[0]
    for name in ("fit", "hold", "ramp"):
        assert getattr(changed, name).damping == getattr(numerics, name).damping * (10.0 if name == stage else 1.0)
    still = numerics.model_copy(update={stage: getattr(changed, stage)})
    assert changed == still


def test_whole_numbers_stay_whole_and_never_vanish(numerics):
    changed, _ = multiplied(numerics, LEVEL, rung(controls__cutbacks=0.01, newton__iterations=2.5), "ramp")
    assert (changed.controls.cutbacks, changed.newton.iterations) == (1, 1000)


@pytest.mark.parametrize(
    "key", ["nothing", "fit.rate", "description", "fit", "controls.nothing", "ramp.damping.more", "mesh", "mesh.level"]
)
def test_a_key_that_is_no_number_of_a_preset_is_refused(numerics, key):
    with pytest.raises(ValueError, match="no number of a numerics preset"):
        multiplied(numerics, LEVEL, Rung(name="a", multiply={key: 2.0}), "fit")


def test_rungs_stand_on_those_before_them(numerics):
    twice = [Rung(name="a", multiply={"newton.load_step": 0.1}), Rung(name="b", multiply={"newton.load_step": 0.1})]
    changed = numerics
    for one in twice:
        changed, level = multiplied(changed, LEVEL, one, "ramp")
    assert level == LEVEL
    assert changed.newton.load_step == pytest.approx(0.01 * numerics.newton.load_step)
    with pytest.raises(ValueError, match="c: hht_alpha"):
        check_ladder([Rung(name="c", multiply={"hht_alpha": 2.0})], numerics, LEVEL)
    with pytest.raises(ValueError, match="d: degrees_of_freedom"):
        check_ladder([Rung(name="d", multiply={"mesh.degrees_of_freedom": 0.1})], numerics, LEVEL)


def test_a_rung_may_put_a_case_on_a_finer_mesh_and_on_another_part_of_the_device(case):
    finer = climb(case, rung(mesh__degrees_of_freedom=2.0), "fit")
    assert finer.mesh_level.degrees_of_freedom == 2 * case.mesh_level.degrees_of_freedom
    half = climb(finer, Rung(name="half", symmetry="front_back"), "fit")
    assert (half.mesh.symmetry, half.mesh_level) == ("front_back", finer.mesh_level)
    assert half.numerics == case.numerics
    assert climb(half, Rung(name="half", symmetry="front_back"), "fit") == half, "nothing to try"
    shells = replace(case, mesh=Mesh(element="S8R", symmetry="full"))
    assert climb(shells, Rung(name="half", symmetry="front_back"), "fit") == shells, "shells are solved as a full device"


def test_the_shipped_ladder_stays_on_the_mesh_of_the_case(loaded, case):
    """A study compares cases on one mesh; who wants results from others among them adds rungs for it."""
    for engine, least in (("calculix", 3), ("newton", 2)):
        rungs = getattr(loaded.config.recovery, engine)
        assert len(rungs) >= least
        for one in rungs:
            changed = climb(case, one, "ramp")
            assert changed.mesh_content() == case.mesh_content()
            assert changed.numerics != case.numerics


@pytest.mark.parametrize(
    ("rungs", "says"),
    [
        ([{"name": "a", "multiply": {"nothing": 2}}], "no number of a numerics preset"),
        ([{"name": "a", "multiply": {"fit.damping": 1e6}}], "fit.damping"),
        ([{"name": "a", "multiply": {"fit.damping": -1}}], "greater than 0"),
        ([{"name": "a", "multiply": {}}], "multiply or symmetry"),
        ([{"name": "a", "symmetry": "third"}], "front_back"),
        ([{"name": "a", "multiply": {"mesh.degrees_of_freedom": 1e4}}], "degrees_of_freedom"),
        ([{"name": "../a", "multiply": {"fit.damping": 2}}], "pattern"),
        ([{"name": "a", "multiply": {"fit.damping": 2}}] * 2, "no name twice"),
        ([{"name": f"r{k}", "multiply": {"fit.damping": 1.1}} for k in range(11)], "at most 10"),
    ],
)
def test_a_ladder_that_cannot_be_climbed_is_one_clear_error(root, tmp_path, rungs, says):
    (tmp_path / "devices").symlink_to(root / "config/devices")
    (tmp_path / "studies").symlink_to(root / "config/studies")
    data = yaml.safe_load((root / "config/config.yaml").read_text())
    data["recovery"] = {"calculix": rungs}
    file = tmp_path / "config.yaml"
    file.write_text(yaml.safe_dump(data))
    with pytest.raises(ConfigError) as error:
        load_config(file)
    assert says in str(error.value)
    assert "recovery.calculix" in str(error.value)
    assert str(file) in str(error.value)
