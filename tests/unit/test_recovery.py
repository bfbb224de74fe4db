"""Rungs of the recovery ladder: what they change, in which stage, and what a configuration may not ask of them."""

import pytest
import yaml

from limo.config import Rung, load_config
from limo.errors import ConfigError
from limo.recovery import check_ladder, climb


@pytest.fixture
def numerics(loaded):
    return loaded.config.numerics_presets["fast"]


def rung(**factors):
    return Rung(name="a_rung", multiply={k.replace("__", "."): v for k, v in factors.items()})


@pytest.mark.parametrize("stage", ["fit", "hold", "ramp"])
def test_factors_reach_the_stage_that_failed_and_nothing_else(numerics, stage):
    changed = climb(numerics, rung(failed__damping=10.0), stage)
    for name in ("fit", "hold", "ramp"):
        assert getattr(changed, name).damping == getattr(numerics, name).damping * (10.0 if name == stage else 1.0)
    still = numerics.model_copy(update={stage: getattr(changed, stage)})
    assert changed == still


def test_whole_numbers_stay_whole_and_never_vanish(numerics):
    changed = climb(numerics, rung(controls__cutbacks=0.01, newton__iterations=2.5), "ramp")
    assert (changed.controls.cutbacks, changed.newton.iterations) == (1, 1000)


@pytest.mark.parametrize("key", ["nothing", "fit.rate", "description", "fit", "controls.nothing", "ramp.damping.more"])
def test_a_key_that_is_no_number_of_a_preset_is_refused(numerics, key):
    with pytest.raises(ValueError, match="no number of a numerics preset"):
        climb(numerics, Rung(name="a", multiply={key: 2.0}), "fit")


def test_rungs_stand_on_those_before_them(numerics):
    twice = [Rung(name="a", multiply={"newton.load_step": 0.1}), Rung(name="b", multiply={"newton.load_step": 0.1})]
    changed = numerics
    for one in twice:
        changed = climb(changed, one, "ramp")
    assert changed.newton.load_step == pytest.approx(0.01 * numerics.newton.load_step)
    with pytest.raises(ValueError, match="c: hht_alpha"):
        check_ladder([Rung(name="c", multiply={"hht_alpha": 2.0})], numerics)


def test_the_shipped_ladder_never_touches_what_a_case_is(loaded):
    """Mesh, symmetry, loads and material are no numerics: what any rung gives is the same case with other numerics."""
    assert len(loaded.config.recovery.calculix) >= 3
    assert len(loaded.config.recovery.newton) >= 2


@pytest.mark.parametrize(
    ("rungs", "says"),
    [
        ([{"name": "a", "multiply": {"nothing": 2}}], "no number of a numerics preset"),
        ([{"name": "a", "multiply": {"fit.damping": 1e6}}], "fit.damping"),
        ([{"name": "a", "multiply": {"fit.damping": -1}}], "greater than 0"),
        ([{"name": "a", "multiply": {}}], "at least 1"),
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
