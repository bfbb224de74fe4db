"""Names of cases and meshes: what they depend on, and what they do not."""

import json
import shutil
from dataclasses import replace
from typing import get_args

import pytest
import yaml

from limo.accuracy.kept_names import lacking
from limo.cases.case import Case
from limo.cases.grid import cross_checks, study_cases
from limo.cases.plan import make_plan
from limo.config.load import load_config
from limo.schema.numerics import LATER, Mesh, MeshLevel, Newton
from limo.schema.study import Axes, Variant
from limo.store.digest import digest, number_label


def device_with(case, part, **changes):
    section = getattr(case.device, part).model_copy(update=changes)
    return {"device": case.device.model_copy(update={part: section})}


def seams_with(case, **changes):
    return case.device.pattern.seams.model_copy(update=changes)


def numerics_with(case, **changes):
    return {"numerics": case.numerics.model_copy(update=changes)}


def newton_with(case, **changes):
    """Other keys of the engine newton, which solves the case."""
    return {"engine": "newton", **numerics_with(case, newton=case.numerics.newton.model_copy(update=changes))}


# what each change is made of, and whether it asks for another mesh
PHYSICAL_CHANGES = {
    "P_v": (lambda c: {"ventricular_pressure": 13.8}, False),
    "build": (lambda c: {"build": "2.22-01234567"}, False),
    "P_a,max": (lambda c: {"actuation_pressure_max": 61.0}, False),
    "AR": (lambda c: {"aspect_ratio": 2.5}, False),
    "E_hat": (lambda c: {"stiffness_ratio": 0.5}, False),
    "E_hat by a hair": (lambda c: {"stiffness_ratio": 1.0 + 1e-9}, False),
    "E": (lambda c: device_with(c, "material", youngs_modulus=268.0), False),
    "nu": (lambda c: device_with(c, "material", poisson_ratio=0.34), False),
    "thickness": (lambda c: device_with(c, "material", thickness=0.2), False),
    "density": (lambda c: device_with(c, "material", areal_density=171.0), False),
    "damping": (lambda c: numerics_with(c, ramp=c.numerics.ramp.model_copy(update={"damping": 1.0})), False),
    "HHT": (lambda c: numerics_with(c, hht_alpha=-0.05), False),
    "controls": (lambda c: numerics_with(c, controls=c.numerics.controls.model_copy(update={"growth": 2.0})), False),
    "element": (lambda c: {"mesh": Mesh(level="preview", symmetry="quarter", element="C3D20")}, False),
    "N_p": (lambda c: {"n_pouches": 10}, True),
    "symmetry": (lambda c: {"mesh": Mesh(level="preview", symmetry="full")}, True),
    "level": (lambda c: {"mesh_level": MeshLevel(degrees_of_freedom=12001, grading=0.8)}, True),
    "grading": (lambda c: {"mesh_level": MeshLevel(degrees_of_freedom=12000, grading=0.9)}, True),
    "width_scale": (lambda c: device_with(c, "pattern", width_scale=0.8), True),
    "length": (lambda c: device_with(c, "pattern", length=141.0), True),
    "seams": (lambda c: device_with(c, "pattern", seams=seams_with(c, spacing_exponent=1.0)), True),
}


@pytest.mark.parametrize("key", LATER)
def test_a_key_that_came_later_names_a_case_where_it_is_not_the_default(make_case, key):
    """Names without it are those of results from before it."""
    case = make_case(**newton_with(make_case()))
    usual = Newton.model_fields[key].default
    (other,) = (value for value in get_args(Newton.model_fields[key].annotation) if value != usual)
    names = [make_case(**newton_with(case, **{key: value})).case_id for value in (usual, other)]
    assert names[0] == case.case_id != names[1]
    assert key not in json.dumps(case.content())
    seen_by_calculix = replace(make_case(**newton_with(case, **{key: other})), engine="calculix")
    assert seen_by_calculix.case_id == make_case().case_id


def test_kept_runs_have_the_names_of_their_cases_still(loaded, root):
    for name in ("reference_np4", "reference_np8", "referee_np4", "referee_np8"):
        assert not any(lacking(loaded, name, root / "docs/gallery/data")), name


@pytest.mark.parametrize("name", PHYSICAL_CHANGES)
def test_every_physical_change_renames_the_case_and_only_some_the_mesh(make_case, name):
    change, another_mesh = PHYSICAL_CHANGES[name]
    case = make_case()
    changed = make_case(**change(case))
    assert changed.case_id != case.case_id
    assert (changed.mesh_id != case.mesh_id) == another_mesh


def test_changes_are_told_apart_from_each_other(make_case):
    case = make_case()
    names = [make_case(**change(case)).case_id for change, _ in PHYSICAL_CHANGES.values()]
    assert len(set(names)) == len(names)


def test_frames_and_descriptions_do_not_rename_a_case(make_case):
    case = make_case()
    same = make_case(frames=(1.0, 2.0), **numerics_with(case, description="other words"))
    assert (same.case_id, same.mesh_id) == (case.case_id, case.mesh_id)


@pytest.mark.parametrize("name", PHYSICAL_CHANGES)
def test_only_the_last_pressure_leaves_the_path_as_it_is(make_case, name):
    change, _ = PHYSICAL_CHANGES[name]
    case = make_case()
    changed = make_case(**change(case))
    assert (changed.path == case.path) == (name == "P_a,max")
    assert (changed.path_on_any_level == case.path_on_any_level) == (name in ("P_a,max", "level", "grading"))


def test_names_are_fit_for_a_path_and_show_the_four_numbers(make_case):
    name = make_case(ventricular_pressure=13.8, stiffness_ratio=1e-5).case_id
    assert name.startswith("limo_np8_pv13.8_ar2_eh0.00001_preview_fast_")
    assert not set(name) - set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.")


def test_order_of_keys_and_comments_do_not_rename_a_case(root, loaded, tmp_path):
    def reverse(data):
        return {k: reverse(v) for k, v in reversed(data.items())} if isinstance(data, dict) else data

    shutil.copytree(root / "config", tmp_path / "config")
    for file in (tmp_path / "config").rglob("*.yaml"):
        file.write_text("# a comment\n" + yaml.safe_dump(reverse(yaml.safe_load(file.read_text())), sort_keys=False))
    shuffled = load_config(tmp_path / "config/config.yaml")
    assert set(make_plan(shuffled, tmp_path).cases) == set(make_plan(loaded, tmp_path).cases)


def test_case_survives_plain_data(make_case):
    """Through JSON, as between processes: equal, with the same names and frames."""
    case = make_case(frames=(0.0, 13.8), **numerics_with(make_case(), description="x"))
    again = Case.from_dict(json.loads(json.dumps(case.to_dict())))
    assert again == case
    assert (again.frames, again.case_id, again.mesh_id) == (case.frames, case.case_id, case.mesh_id)


@pytest.mark.parametrize(
    ("value", "label"),
    [(3.8, "3.8"), (2.0, "2"), (10, "10"), (100.0, "100"), (0.1 + 0.2, "0.3"), (1e-5, "0.00001"), (0.0, "0"), (1000.0, "1000")],
)
def test_number_label_is_short_and_has_no_exponent(value, label):
    assert number_label(value) == label


def test_digest_knows_content_not_order():
    assert digest({"a": 1, "b": [1, 2]}) == digest({"b": [1, 2], "a": 1})
    assert digest({"a": [1, 2]}) != digest({"a": [2, 1]})


# --------------------------------------------------------------------------------------------------------------------
# studies


def test_cases_of_a_study_are_its_grid(loaded):
    study = loaded.studies["pressure_volume"]
    axes = study.axes.model_copy(update={"aspect_ratio": [1.0, 2.0], "width_scale": [0.8, 1.0]})
    wider = type(loaded)(loaded.config, loaded.devices, {"wider": study.model_copy(update={"axes": axes})}, loaded.files)
    cases = study_cases(wider, "wider")
    assert len(cases) == len(axes.n_pouches) * len(axes.ventricular_pressure) * 2 * 2
    for (n_pouches, pressure, aspect, stiffness, scale, *_), case in cases.items():
        assert (case.n_pouches, case.ventricular_pressure, case.aspect_ratio) == (n_pouches, pressure, aspect)
        assert (case.stiffness_ratio, case.device.pattern.width_scale) == (stiffness, scale)
        assert case.actuation_pressure_max == study.maximum_for(pressure)
    assert len({c.case_id for c in cases.values()}) == len(cases)
    assert len({c.mesh_id for c in cases.values()}) == len(axes.n_pouches) * 2, "meshes are shared over AR"


def test_cases_that_studies_share_are_run_once_with_the_frames_of_both(loaded, tmp_path):
    study = loaded.studies["pressure_volume"]
    other = study.model_copy(update={"frames": [7.0, "max"], "description": "the same cases"})
    both = type(loaded)(loaded.config, loaded.devices, {"one": study, "two": other}, loaded.files)
    cases = make_plan(both, tmp_path).cases
    assert len(cases) == len(study_cases(both, "one"))
    for case in cases.values():
        expected = {*study.frames_for(case.ventricular_pressure), 7.0, case.actuation_pressure_max}
        assert list(case.frames) == sorted(expected)


def with_study(loaded, **changes):
    """The configuration with one study ``s``: that of the default with other values."""
    study = loaded.studies["pressure_volume"].model_copy(update=changes)
    builds = {"calculix": "2.20", "newton": "mkl"}
    return type(loaded)(loaded.config, loaded.devices, {"s": study}, loaded.files, builds=builds)


def test_the_engine_its_build_and_its_own_numerics_name_a_result(loaded, make_case):
    case = make_case()
    newton = replace(case, engine="newton")
    assert newton.case_id != case.case_id != replace(case, build="other").case_id
    damped = case.numerics.model_copy(update={"ramp": case.numerics.ramp.model_copy(update={"damping": 1.0e5})})
    stepped = case.numerics.model_copy(update={"newton": case.numerics.newton.model_copy(update={"load_step": 3.0})})
    assert replace(case, numerics=damped).case_id != case.case_id == replace(case, numerics=stepped).case_id
    assert replace(newton, numerics=stepped).case_id != newton.case_id == replace(newton, numerics=damped).case_id


def test_branches_are_cases_of_their_own_on_one_mesh(loaded):
    cases = study_cases(with_study(loaded, branches=3), "s")
    assert sorted({point.branch for point in cases}) == [0, 1, 2]
    assert len({c.case_id for c in cases.values()}) == len(cases) == 12
    assert len({c.mesh_id for c in cases.values()}) == 4
    plain = study_cases(with_study(loaded), "s")
    assert all(cases[key].case_id == case.case_id for key, case in plain.items()), "branch 0 is the case without branches"


def test_a_study_changes_keys_of_its_numerics_and_variants_change_more(loaded):
    axes, finer = Axes(n_pouches=[6], ventricular_pressure=[3.8]), {"newton": {"load_step": 0.25}}
    variants = {
        "plain": Variant(engine="newton"),
        "shorter": Variant(engine="newton", numerics={"newton": {"largest_step": 0.05}}),
        "anew": Variant(engine="newton", numerics="fast"),
        "other": Variant(),
    }
    (usual,) = study_cases(with_study(loaded, axes=axes, engine="newton"), "s").values()
    (calculix,) = study_cases(with_study(loaded, axes=axes), "s").values()
    cases = study_cases(with_study(loaded, axes=axes, numerics=finer, variants=variants), "s")
    found = {point.variant: case for point, case in cases.items()}
    steps = {name: (case.numerics.newton.load_step, case.numerics.newton.largest_step) for name, case in found.items()}
    usual_steps = usual.numerics.newton.load_step, usual.numerics.newton.largest_step
    assert steps == {"plain": (0.25, usual_steps[1]), "shorter": (0.25, 0.05), "anew": usual_steps, "other": usual_steps}
    assert found["anew"] == usual, "a preset by name takes the place of all the study said"
    assert found["other"].case_id == calculix.case_id, "CalculiX takes no load steps: its case is the same"


def test_variants_differ_from_the_study_in_what_they_name_only(loaded):
    variants = {
        "plain": Variant(),
        "half": Variant(mesh={"symmetry": "front_back"}),
        "literal": Variant(numerics="paper"),
        "damped": Variant(numerics={"ramp": {"damping": 5.0e6}}),
        "other": Variant(engine="newton"),
        "thick": Variant(material={"thickness": 0.3}),
        "small": Variant(device="mini_limo"),
    }
    axes = Axes(n_pouches=[8], ventricular_pressure=[3.8])
    found = {point.variant: case for point, case in study_cases(with_study(loaded, axes=axes, variants=variants), "s").items()}
    (plain,) = study_cases(with_study(loaded, axes=axes), "s").values()
    assert found["plain"] == plain
    assert found["half"] == replace(plain, mesh=plain.mesh.model_copy(update={"symmetry": "front_back"}))
    assert found["literal"].numerics == loaded.config.numerics_presets["paper"].for_engine("calculix")
    ramp = plain.numerics.ramp.model_copy(update={"damping": 5.0e6})
    assert found["damped"] == replace(plain, numerics=plain.numerics.model_copy(update={"ramp": ramp}))
    assert (found["thick"].device.material.thickness, plain.device.material.thickness) == (0.3, 0.19)
    assert found["thick"].device.pattern == plain.device.pattern
    assert found["other"].engine == "newton"
    assert found["small"].device == loaded.devices["mini_limo"]
    assert len({case.case_id for case in found.values()}) == 7


@pytest.mark.parametrize(("asked", "pouches"), [(0, []), (1, [4]), (2, [4, 10]), (3, [4, 8, 10]), (9, [4, 6, 8, 10])])
def test_cross_checks_are_spread_over_the_grid_and_solved_by_the_other_engine(loaded, asked, pouches):
    twins = cross_checks(with_study(loaded, engine="newton", branches=2, cross_check=asked), "s")
    assert [point.n_pouches for point in twins] == pouches
    assert {(t.engine, t.build, t.branch) for t in twins.values()} <= {("calculix", "2.20", 0)}
