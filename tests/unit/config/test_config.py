"""The configuration: every mistake is one ``ConfigError`` that says what to do, and never anything else."""

import contextlib
import copy
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import jsonschema
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter
from pydantic.fields import FieldInfo

from limo.cases.case import Case
from limo.cases.grid import study_cases
from limo.cases.plan import make_plan
from limo.config import checks as config_checks
from limo.config import project as config_project
from limo.config.json_schemas import json_schemas
from limo.config.load import ALL, RULES, load_config
from limo.config.project import same_content
from limo.config.targets import asked_studies
from limo.config.yaml_file import read_yaml
from limo.errors import ConfigError, LimoError
from limo.schema.numerics import Mesh
from limo.schema.section import Section
from limo.schema.study import Study
from limo.store.results import Results

CONFIG, DEVICE, STUDY, AIRBAG = "config.yaml", "devices/limo.yaml", "studies/pressure_volume.yaml", "airbags/classical.yaml"
AXES, PATTERN = ("axes",), ("pattern",)
DELETE = object()


@pytest.fixture
def folder(root, tmp_path):
    """A copy of the shipped configuration with one study and one number of pouches."""
    shutil.copytree(root / "config", tmp_path / "config")
    study = tmp_path / "config" / STUDY
    data = yaml.safe_load(study.read_text())
    data["axes"]["n_pouches"] = [10]
    for other in (tmp_path / "config/studies").iterdir():
        other.unlink()
    data.pop("measured", None)
    study.write_text(yaml.safe_dump(data))
    main = tmp_path / "config" / CONFIG
    main.write_text(yaml.safe_dump(yaml.safe_load(main.read_text()) | {"studies": ["pressure_volume"]}))
    return tmp_path / "config"


def put(data, path, value):
    """``data`` with ``value`` at ``path``, a missing section made on the way; ``DELETE`` removes the key."""
    data = copy.deepcopy(data)
    inner = data
    for key in path[:-1]:
        inner = inner[key] if isinstance(inner, list) else inner.setdefault(key, {})
    if value is DELETE:
        del inner[path[-1]]
    else:
        inner[path[-1]] = value
    return data


def edit(file: Path, path, value):
    file.write_text(yaml.safe_dump(put(yaml.safe_load(file.read_text()), path, value)))


def error_of(folder):
    with pytest.raises(ConfigError) as caught:
        load_config(folder / CONFIG, strict=True)
    return caught.value


# --------------------------------------------------------------------------------------------------------------------
# single mistakes: file, path of the key, value, and what the message must say is expected there

N_P, P_V, AR, E_HAT = ((*AXES, a) for a in ("n_pouches", "ventricular_pressure", "aspect_ratio", "stiffness_ratio"))
P_MAX, FAST = ("actuation_pressure_max",), ("numerics_presets", "fast")
MISTAKES = [
    (CONFIG, ("colour",), "red", "numerics_presets"),
    (CONFIG, ("solver", "thread"), 2, "threads"),
    (CONFIG, (*FAST, "fit", "dampening"), 1.0, "damping"),
    (CONFIG, ("mesh_levels", "preview", "size"), 1.0, "grading"),
    (DEVICE, ("patern",), {}, "pattern"),
    (DEVICE, (*PATTERN, "valve", "aspect"), 2.0, "at_aspect_ratio"),
    (STUDY, ("pouches",), [8], "axes"),
    (STUDY, (*AXES, "n_pouch"), [8], "n_pouches"),
    (STUDY, N_P, [7], "multiple of 2"),
    (STUDY, N_P, [0], "an even number from 2 to 16"),
    (STUDY, N_P, [-2], "greater than or equal to 0"),
    (STUDY, N_P, [0, 8], "0 alone"),
    (STUDY, N_P, [8, 18], "less than or equal to 16"),
    (STUDY, N_P, [8, 8], "twice"),
    (STUDY, N_P, [], "at least 1"),
    (STUDY, N_P, 8, "list"),
    (STUDY, N_P, ["eight"], "integer"),
    (STUDY, N_P, [8.5], "integer"),
    (STUDY, N_P, DELETE, "missing"),
    (STUDY, AR, [0.5], "greater than or equal to 1"),
    (STUDY, P_V, [-3.8], "greater than or equal to 0"),
    (STUDY, P_V, [float("nan")], "finite"),
    (STUDY, P_V, [float("inf")], "finite"),
    (STUDY, E_HAT, [0.0], "greater than 0"),
    (STUDY, E_HAT, [-1.0], "greater than 0"),
    (STUDY, AXES, DELETE, "missing"),
    (STUDY, P_MAX, DELETE, "more than P_v = 3.8"),
    (STUDY, P_MAX, 3.8, "more than P_v = 3.8"),
    (STUDY, P_MAX, {3.8: 2.0}, "more than P_v = 3.8"),
    (STUDY, P_MAX, {13.8: 100.0}, "P_v = 3.8"),
    (STUDY, P_MAX, {3.8: -60.0}, "greater than or equal to 0"),
    (STUDY, P_MAX, 0, "more than P_v = 3.8"),
    (STUDY, P_MAX, "high", "number"),
    (STUDY, P_MAX, float("nan"), "finite"),
    (STUDY, ("frames",), [0.0, 60.5], "up to actuation_pressure_max = 60"),
    (STUDY, ("frames",), [-1.0], "no negative pressure"),
    (STUDY, ("frames",), ["P_v + x"], "P_v + number"),
    (STUDY, ("frames",), ["P_v * 2"], "P_v + number"),
    (STUDY, ("frames",), ["min"], "P_v + number"),
    (STUDY, ("frames",), [float("nan")], "pressures"),
    (STUDY, ("frames",), [None], "pressures"),
    (STUDY, ("device",), "lima", "limo"),
    (STUDY, ("numerics",), "fastest", "fast"),
    (STUDY, ("numerics", "ramp", "damping"), -1.0, "greater than or equal to 0"),
    (STUDY, ("numerics", "newton", "colour"), "red", "load_step"),
    (STUDY, ("numerics", "newton", "factor_precision"), "half", "'single' or 'double'"),
    (STUDY, ("numerics", "newton", "geometric_stiffness"), "none", "'consistent' or 'mixed'"),
    (STUDY, ("numerics", "newton", "fit_via"), [0.5], "multiples from 1 to 100"),
    (STUDY, ("numerics", "newton", "fit_via"), [1, 1], "each once"),
    (STUDY, ("numerics", "newton", "fit_via"), [], "at least 1 item"),
    (CONFIG, (*FAST, "newton", "factor_precision"), 32, "'single' or 'double'"),
    (STUDY, ("preset",), "exact", "preview, reference, shells, standard"),
    (STUDY, ("mesh", "level"), "huge", "preview"),
    (STUDY, ("mesh", "symmetry"), "half", "quarter"),
    (STUDY, ("mesh",), {"level": "preview", "element": "S8", "symmetry": "quarter"}, "full"),
    (STUDY, ("variants", "half", "pouches"), 8, "numerics"),
    (STUDY, ("variants", "half"), {"numerics": "quick"}, "fast"),
    (STUDY, ("variants", "half", "numerics", "ramp", "damping"), -1.0, "greater than or equal to 0"),
    (STUDY, ("variants", "half", "numerics", "ramp", "colour"), "red", "damping"),
    (STUDY, ("variants", "half"), {"device": "heart"}, "mini_limo"),
    (STUDY, ("variants", "half", "material", "thickness"), 0.0, "greater than 0"),
    (STUDY, ("material", "thickness"), 50.0, "less than or equal to 5"),
    (STUDY, ("material", "colour"), "red", "areal_density"),
    (STUDY, ("material", "thickness"), 0.00019, "thickness in m would be 0.19"),
    (STUDY, ("material", "areal_density"), 0.17, "areal_density in kg/m^2 would be 170"),
    (STUDY, ("variants", "half", "mesh", "level"), "huge", "preview"),
    (STUDY, ("variants", "a half"), {}, "pattern"),
    (STUDY, ("figures",), ["pie"], "pressure_volume"),
    (STUDY, ("pressure_step",), 0.0, "greater than or equal to 0.01"),
    (STUDY, ("measured",), "config/measured/absent.csv", "CSV"),
    (STUDY, ("description",), ["a"], "string"),
    (CONFIG, ("studies",), ["absent"], "pressure_volume"),
    (CONFIG, ("studies",), [], "at least 1"),
    (CONFIG, ("mesh", "level"), "huge", "preview"),
    (CONFIG, ("numerics",), "fastest", "fast"),
    (CONFIG, ("presets", "standard", "mesh", "level"), "huge", "preview"),
    (CONFIG, ("presets", "standard", "numerics"), "fastest", "fast"),
    (CONFIG, ("presets", "standard", "accuracy"), 0.02, "engine"),
    (CONFIG, ("presets", "standard", "mesh"), {"element": "S8", "symmetry": "full"}, "engine: calculix"),
    (CONFIG, ("mesh_levels", "preview", "degrees_of_freedom"), 10, "greater than or equal to"),
    (CONFIG, (*FAST, "ramp", "rate"), DELETE, "rate"),
    (CONFIG, (*FAST, "fit", "duration"), DELETE, "duration"),
    (CONFIG, (*FAST, "hold", "damping"), 0.0, "zero in all"),
    (CONFIG, (*FAST, "hht_alpha"), -0.5, "greater than or equal to"),
    (CONFIG, (*FAST, "fit"), [], "dictionary"),
    (CONFIG, ("solver", "threads"), 0, "greater than or equal to 1"),
    (DEVICE, ("material", "youngs_modulus"), "stiff", "number"),
    (DEVICE, ("material", "youngs_modulus"), True, "number"),
    (DEVICE, ("material", "poisson_ratio"), 0.5, "less than 0.5"),
    (DEVICE, ("material", "thickness"), None, "number"),
    (DEVICE, ("material",), DELETE, "missing"),
    (AIRBAG, ("colour",), "red", "thickness"),
    (AIRBAG, ("side",), 0.0, "greater than 0"),
    (AIRBAG, ("thickness",), -1.0, "greater than 0"),
    (AIRBAG, ("youngs_modulus",), "stiff", "number"),
    (AIRBAG, ("poisson_ratio",), 0.5, "less than 0.5"),
    (AIRBAG, ("pressure",), DELETE, "missing"),
    (AIRBAG, ("series",), [], "at least 1"),
    (AIRBAG, ("series",), [{"element": "S8", "divisions": [4]}] * 2, "one entry for an element"),
    (AIRBAG, ("series", 0, "element"), "S9", "C3D20R"),
    (AIRBAG, ("series", 0, "divisions"), [8, 4], "rising"),
    (AIRBAG, ("series", 0, "divisions"), [1, 4], "greater than or equal to 2"),
    (AIRBAG, ("series", 0, "path"), [-1.0], "greater than 0"),
    (AIRBAG, ("series", 0, "engine"), "newton", "calculix for element S3"),
    (AIRBAG, ("series", 0, "planes"), "symmetric", "hinged for element S3"),
    (AIRBAG, ("numerics", "damping_share"), 2.0, "less than or equal to 1"),
    (AIRBAG, ("numerics", "largest_increment"), 1e-5, "rising order"),
    (DEVICE, (*PATTERN, "length"), float("inf"), "finite"),
    (DEVICE, (*PATTERN, "valve", "flat_half_width_over_length"), 0.4, "exactly one"),
    (DEVICE, (*PATTERN, "width_scale"), 3.0, "less than or equal to 1.5"),
    (DEVICE, (*PATTERN, "outline"), [[[0.4, 0.0], [0.4]]], "missing"),
    (DEVICE, (*PATTERN, "outline"), [[[0.4, 0.0], [0.5, 0.5]], [[0.45, 0.5], [0.0, 1.0]]], "end to start"),
    (DEVICE, (*PATTERN, "outline"), [[[0.397, 0.0], [0.5, 0.6], [0.3, 0.4], [0.6, 0.3], [0.0, 1.0]]], "cross"),
    (DEVICE, (*PATTERN, "seams", "fractions"), {10: [0.5, 0.505]}, "cross or touch"),
    (DEVICE, (*PATTERN, "seams", "fractions"), {10: [0.5, 3.0]}, "inside"),
    (DEVICE, (*PATTERN, "seams", "fractions"), {10: [1.3, 0.5]}, "increasing"),
    (DEVICE, (*PATTERN, "seams", "fractions"), {10: [0.0, 1.0]}, "off the axis"),
    (DEVICE, (*PATTERN, "seams", "fractions"), {8: [0.5, 1.0]}, "on the axis"),
    (DEVICE, (*PATTERN, "seams", "fractions"), {9: [0.5]}, "even"),
    (DEVICE, (*PATTERN, "valve"), DELETE, "(0, 0)"),
    (DEVICE, (*PATTERN, "seams"), DELETE, "pouch_array and seams together"),
    (DEVICE, (*PATTERN, "pouch_array"), DELETE, "pouch_array and seams together"),
]


def mistake_id(mistake):
    return f"{mistake[1][-1]}={'absent' if mistake[2] is DELETE else str(mistake[2])[:30]}"


@pytest.mark.parametrize(("file", "path", "value", "expected"), MISTAKES, ids=map(mistake_id, MISTAKES))
def test_mistake_is_one_message_with_file_key_value_expectation_and_example(folder, file, path, value, expected):
    edit(folder / file, path, value)
    error = error_of(folder)
    message = str(error)
    assert str(folder / file) in message
    named = [k for k in path if isinstance(k, str)]
    if any(k in error.key for k in named[-2:]):
        assert isinstance(value, dict | list) or value is DELETE or named[-1] not in error.key or repr(value) in message
    else:  # a rule between keys: the section is named, and the rule names the key
        assert named[0] in error.key
        assert named[-1] in error.expected
    assert expected in error.expected
    assert error.example
    assert "for example" in message
    assert "\n" not in message


# keys whose mistake has no example of its own: unknown keys, rules between keys, and curves that must fit each other
WITHOUT_EXAMPLE = {
    *("colour", "thread", "dampening", "size", "patern", "aspect", "pouches", "n_pouch", "accuracy"),
    *("mesh", "fit", "damping", "flat_half_width_over_length", "measured", "outline", "fractions"),
}
HEALABLE = [m for m in MISTAKES if m[2] is not DELETE and m[1][-1] not in WITHOUT_EXAMPLE]


@pytest.mark.parametrize(("file", "path", "value", "_expected"), HEALABLE, ids=map(mistake_id, HEALABLE))
def test_the_example_in_a_message_mends_the_mistake(folder, file, path, value, _expected):
    edit(folder / file, path, value)
    error = error_of(folder)
    example = yaml.safe_load(error.example)
    assert isinstance(example, dict), error.example
    ((key, good),) = example.items()
    key = key.split(".")[-1]
    assert key in path
    edit(folder / file, path[: path.index(key) + 1], good)
    with contextlib.suppress(ConfigError):
        load_config(folder / CONFIG, strict=True)
        return
    next_error = error_of(folder)  # the example may ask for another key to follow
    assert key not in next_error.key, str(next_error)


# --------------------------------------------------------------------------------------------------------------------
# files that are not what they should be

BROKEN_TEXT = {
    "duplicate key": ("device: limo\ndevice: limo\n", "device"),
    "duplicate inner key": ("axes:\n  n_pouches: [8]\n  n_pouches: [8]\n", "n_pouches"),
    "not YAML": ("axes: [1, 2\nframes: }", "YAML"),
    "tab": ("axes:\n\tn_pouches: [8]\n", "YAML"),
    "unknown tag": ("axes: !!python/object:os.system {}\n", "YAML"),
    "a list": ("- 1\n- 2\n", "mapping"),
    "a text": ("hello\n", "mapping"),
    "empty": ("", "mapping"),
    "list as key": ("? [1, 2]\n: 3\n", "YAML"),
    "nested without end": ("[" * 5000, "YAML"),
    "impossible date": ("description: 2020-13-45\n", "YAML"),
    "control character": ("description: \x01\n", "YAML"),
}


@pytest.mark.parametrize(("file", "name"), [*((STUDY, n) for n in BROKEN_TEXT), (CONFIG, "a list"), (DEVICE, "empty")])
def test_text_that_is_no_configuration_is_a_config_error(folder, file, name):
    text, says = BROKEN_TEXT[name]
    (folder / file).write_text(text)
    error = error_of(folder)
    assert str(folder / file) in str(error)
    assert says in str(error)


@pytest.mark.parametrize("file", [CONFIG, DEVICE, STUDY])
def test_key_that_is_a_number_is_named(folder, file):
    (folder / file).write_text((folder / file).read_text() + "\n17: 2\n")
    error = error_of(folder)
    assert "17" in error.key
    assert "string" in error.expected


def test_files_that_cannot_be_read_are_config_errors(folder):
    (folder / STUDY).write_bytes(b"description: \xff\xfe\n")
    assert str(folder / STUDY) in str(error_of(folder))
    (folder / STUDY).unlink()
    (folder / STUDY).mkdir()
    assert str(folder / STUDY) in str(error_of(folder))
    with pytest.raises(ConfigError, match=r"absent\.yaml"):
        load_config(folder / "absent.yaml")


def test_two_files_of_one_name_and_names_that_are_no_names_are_refused(folder):
    shutil.copy(folder / STUDY, folder / "studies/pressure_volume.yml")
    assert "one file for a name" in str(error_of(folder))
    (folder / "studies/pressure_volume.yml").rename(folder / "studies/2-nd.yaml")
    assert "2-nd" in str(error_of(folder))


ODD_VALUES = st.one_of(
    st.none(), st.booleans(), st.integers(-(10**30), 10**30), st.floats(), st.text(max_size=5), st.dates(),
    st.lists(st.floats() | st.none(), max_size=3), st.dictionaries(st.integers() | st.text(max_size=3), st.floats(), max_size=2),
)  # fmt: skip


def leaves(data, path=()):
    if isinstance(data, dict | list):
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield (*path, key)
            yield from leaves(value, (*path, key))


@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_value_anywhere_raises_anything_but_a_config_error(folder, data):
    """Any odd value at any key of any file: it is either accepted or refused with a ``ConfigError``."""
    file = folder / data.draw(st.sampled_from([CONFIG, DEVICE, STUDY]))
    text = file.read_text()
    content = yaml.safe_load(text)
    path = data.draw(st.sampled_from(list(leaves(content))))
    file.write_text(yaml.safe_dump(put(content, path, data.draw(ODD_VALUES))))
    try:
        for strict in (False, True):
            with contextlib.suppress(LimoError):
                load_config(folder / CONFIG, strict=strict)
    finally:
        file.write_text(text)


# --------------------------------------------------------------------------------------------------------------------
# what is accepted


def test_numbers_with_an_exponent_need_no_decimal_point(tmp_path):
    """YAML 1.1 would read 1e6 as text."""
    (tmp_path / "a.yaml").write_text("a: 1e6\nb: 1.5e-3\nc: -2E3\nd: 12\n")
    assert read_yaml(tmp_path / "a.yaml") == {"a": 1e6, "b": 1.5e-3, "c": -2000.0, "d": 12}


@pytest.mark.parametrize(
    ("frames", "pressures"),
    [
        (["P_v + 10"], [13.8]),
        (["P_v+10", "P_v - 2.5", " P_v "], [1.3, 3.8, 13.8]),
        (["max", "max - 10", 60], [50.0, 60.0]),
        ([30, 0, 10.5], [0.0, 10.5, 30.0]),
        (["P_v + 60", "P_v - 10", 0], [0.0]),  # beyond P_a,max and below zero
    ],
)
def test_frames_become_pressures_in_order(frames, pressures):
    study = Study(axes={"n_pouches": [8], "ventricular_pressure": [3.8]}, actuation_pressure_max={3.8: 60}, frames=frames)
    assert study.frames_for(3.8) == pytest.approx(pressures)


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"engine": "calculix"}, "engine", "engine newton alone with actuation_volume"),
        ({"cross_check": 1, "mesh": {"element": "C3D20R"}}, "cross_check", "calculix drives a device by P_a"),
        ({"actuation_pressure_max": 60}, "actuation_volume", "none beside actuation_pressure_max"),
        ({"actuation_volume": [0, 80]}, "actuation_volume", "begin with rest"),
        ({"actuation_volume": ["rest", 80, 80]}, "actuation_volume", "and move"),
        ({"actuation_volume": ["rest", -1]}, "actuation_volume", "way of V_a in ml"),
        ({"actuation_volume": ["rest"]}, "actuation_volume", "at least 2"),
        ({"actuation_volume": ["rest", 3000]}, "actuation_volume", "way of V_a in ml"),
    ],
    ids=lambda x: str(x)[:30],
)
def test_a_syringe_takes_the_place_of_the_ramp(folder, changes, key, words):
    """Engine newton alone drives a device by V_a; P_a,max is then none, and cases differ from those of a ramp."""
    study = {"axes": {"n_pouches": [8], "ventricular_pressure": [3.8]}, "engine": "newton", "frames": [0]}
    study |= {"actuation_volume": ["rest", 80, "rest"], "figures": ["loops"]}
    (folder / STUDY).write_text(yaml.safe_dump(study))
    loaded, name = load_config(folder / CONFIG, strict=True), Path(STUDY).stem
    assert loaded.studies[name].syringe == (80.0, None)
    (case,) = study_cases(loaded, name).values()
    assert (case.actuation_pressure_max, case.cycle, case.syringe) == (0.0, (), (80.0, None))
    assert Case.from_dict(case.to_dict()) == case
    assert case.case_id != replace(case, syringe=()).case_id
    (folder / STUDY).write_text(yaml.safe_dump(study | changes))
    error = error_of(folder)
    assert error.key.startswith(key)
    assert words in str(error)
    assert error.example


@pytest.mark.parametrize(
    ("outputs", "needed"),
    [(["volumes"], [0, 3.8, 13.8]), (["volumes", "contact"], [0, 3.8, 13.8]), (["volumes", "stress"], [0, 3.8, 13.8, 55, 60])],
)
def test_a_study_of_volumes_alone_needs_no_frame_at_its_end(outputs, needed):
    frames = [0, "P_v", "P_v + 10", "max - 5", "max", "P_v + 60"]
    axes = {"n_pouches": [8], "ventricular_pressure": [3.8]}
    study = Study(axes=axes, actuation_pressure_max=60, frames=frames, outputs=outputs)
    assert study.needed_frames(3.8) == pytest.approx(needed)


def test_maximum_pressure_is_one_number_or_one_a_ventricular_pressure():
    axes = {"n_pouches": [8], "ventricular_pressure": [3.8, 13]}
    each = Study(axes=axes, actuation_pressure_max={3.8: 60, 13: 100})
    assert [each.maximum_for(p) for p in (3.8, 13.0)] == [60.0, 100.0]
    assert Study(axes=axes, actuation_pressure_max=70).maximum_for(13.0) == 70.0


@pytest.mark.parametrize(
    ("changes", "key", "expected"),
    [
        ({"engine": "calculix"}, "engine", "element C3D20R or C3D20, which"),
        ({"engine": "newton", "cross_check": 2}, "cross_check", "element C3D20R or C3D20, which"),
    ],
    ids=["engine", "cross_check"],
)
def test_shells_with_directors_are_newtons_alone(folder, changes, key, expected):
    for name, value in ({"mesh": {"element": "SHELL8R"}} | changes).items():
        edit(folder / STUDY, (name,), value)
    error = error_of(folder)
    assert (error.key, error.example != "") == (key, True)
    assert expected in error.expected
    edit(folder / STUDY, ("mesh",), {"element": "C3D20R"})
    load_config(folder / CONFIG, strict=True)


WEAVE = {"warp_modulus": 400, "weft_modulus": 100, "poisson_ratio": 0.3, "shear_modulus": 40}


@pytest.mark.parametrize(
    ("changes", "key", "expected"),
    [
        ({"material": {"weave": WEAVE | {"angle": 30}}}, "mesh.symmetry", "front_back or full"),
        ({"material": {"weave": WEAVE | {"angle": 91}}}, "material.weave.angle", "or equal to 90"),
        ({"material": {"weave": WEAVE | {"poisson_ratio": 1.1}}}, "material.weave", "may be up to 1"),
        ({"material": {"weave": WEAVE | {"shear_modulus": 0}}}, "material.weave.shear_modulus", "greater than 0"),
        ({"material": {"bending_factor": 4.1}}, "material.bending_factor", "or equal to 4"),
        ({"material": {"bending_factor": 0}}, "material.bending_factor", "greater than 0"),
        ({"axes": {"n_pouches": [8], "ventricular_pressure": [3.8], "fabric_angle": [0]}}, "axes.fabric_angle", "isotropic"),
        (
            {"material": {"weave": WEAVE}, "mesh": {"element": "S8R", "symmetry": "full"}, "outputs": ["volumes"]},
            "mesh.element",
            "SHELL8R for a woven fabric",
        ),
    ],
    ids=["mirror", "angle", "indefinite", "shear", "stiff", "soft", "no yarns", "shells"],
)
def test_fabric_that_cannot_be_is_refused(folder, changes, key, expected):
    for name, value in changes.items():
        edit(folder / STUDY, (name,), value)
    error = error_of(folder)
    assert error.key == key
    assert expected in str(error)
    assert error.example
    edit(folder / STUDY, ("material",), {"weave": WEAVE | {"angle": 30}, "bending_factor": 0.05})
    edit(folder / STUDY, ("mesh",), {"symmetry": "quarter"})
    edit(
        folder / STUDY,
        ("axes",),
        {"n_pouches": [8], "ventricular_pressure": [3.8], "fabric_angle": [0, 45], "bending_factor": [1]},
    )
    cases = study_cases(load_config(folder / CONFIG, strict=True), Path(STUDY).stem).values()
    assert [case.mesh.symmetry for case in cases] == ["quarter", "front_back"]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["corse"], "coarsest, fine, medium"),
        (["coarse"], "from coarse to fine, all coarser than coarse"),
        (["fine"], "from coarse to fine, all coarser than coarse"),
        (["preview", "coarsest"], "from coarse to fine"),
        (["preview", "preview"], "from coarse to fine"),
    ],
)
def test_a_device_is_fitted_on_ever_finer_meshes_coarser_than_its_own(folder, names, expected):
    edit(folder / STUDY, ("mesh",), {"level": "coarse"})
    edit(folder / STUDY, ("engine",), "newton")
    edit(folder / STUDY, ("numerics",), {"newton": {"fit_on": names}})
    error = error_of(folder)
    assert (error.key, error.value) == ("numerics.newton.fit_on", names if names != ["corse"] else "corse")
    assert expected in error.expected
    assert "fit_on: [" in error.example
    edit(folder / STUDY, ("numerics", "newton", "fit_on"), ["coarsest", "preview"])
    load_config(folder / CONFIG, strict=True)


NESTED = {"newton": {"fit_on": ["preview", "fine"]}}


@pytest.mark.parametrize(
    ("at", "value", "key", "words"),
    [
        ((STUDY, ("numerics",)), NESTED, "numerics.newton.fit_on", "all coarser than preview"),
        (
            (CONFIG, ("presets", "preview", "numerics")),
            "touching",
            "presets.preview.numerics.newton.fit_on",
            "coarser than preview",
        ),
        ((CONFIG, ("presets", "standard", "engine")), "calculix", "presets.standard.engine", "newton for element SHELL8R"),
        (
            (CONFIG, ("presets", "as_in_paper", "numerics")),
            "touching_at_once",
            "presets.as_in_paper.numerics.contact",
            "engine newton",
        ),
        (
            (CONFIG, ("stress_test", "numerics")),
            "touching_at_once",
            "stress_test.numerics.contact",
            "no contact with engine calculix",
        ),
        ((CONFIG, ("stress_test", "numerics")), "nested", "stress_test.numerics", "without fit_on"),
        ((CONFIG, ("stress_test", "mesh", "element")), "SHELL8R", "stress_test.mesh.element", "bricks"),
    ],
)
def test_levers_are_judged_for_every_engine_that_takes_them(folder, at, value, key, words):
    """For the cross check of a study of CalculiX, too, for presets that no study names, and for the stress test."""
    edit(folder / STUDY, ("engine",), "calculix")
    edit(folder / STUDY, ("cross_check",), 1)
    fast = yaml.safe_load((folder / CONFIG).read_text())["numerics_presets"]["fast"]
    edit(folder / CONFIG, ("numerics_presets", "nested"), fast | {"newton": {"fit_on": ["coarsest"]}})
    edit(folder / CONFIG, ("presets", "as_in_paper", "engine"), "calculix")
    load_config(folder / CONFIG, strict=True)
    edit(folder / at[0], at[1], value)
    error = error_of(folder)
    assert error.key == key
    assert words in str(error)
    assert error.example


def test_study_overrides_the_default_mesh_and_numerics(folder):
    edit(folder / STUDY, ("mesh",), {"level": "coarse", "symmetry": "full"})
    edit(folder / STUDY, ("numerics",), "paper")
    loaded = load_config(folder / CONFIG)
    setting = loaded.settings("pressure_volume")[""]
    assert (setting.mesh.level, setting.mesh.symmetry, setting.preset) == ("coarse", "full", "paper")
    content = loaded.content("pressure_volume")
    assert content["settings"][""]["mesh_level"] == loaded.config.mesh_levels["coarse"].model_dump(mode="json")
    assert json.loads(json.dumps(content)) == content, "goes into a dataset's attributes"


def test_a_preset_stands_for_mesh_numerics_and_engine_that_are_not_stated(folder):
    edit(folder / CONFIG, ("presets", "standard"), {"mesh": {"level": "medium"}, "numerics": "paper", "engine": "newton"})
    edit(folder / STUDY, ("preset",), "standard")
    loaded = load_config(folder / CONFIG)
    setting = loaded.settings("pressure_volume")[""]
    assert (setting.mesh, setting.preset, setting.engine) == (Mesh(level="medium"), "paper", "newton")
    edit(folder / STUDY, ("mesh",), {"level": "coarse"})
    edit(folder / STUDY, ("engine",), "calculix")
    edit(folder / STUDY, ("variants",), {"fast": {"numerics": "fast"}})
    loaded = load_config(folder / CONFIG)
    setting = loaded.settings("pressure_volume")["fast"]
    assert (setting.mesh.level, setting.preset, setting.engine) == ("coarse", "fast", "calculix"), "what is stated comes on top"


def test_a_configuration_says_what_it_has_otherwise_than_another(folder):
    edit(folder / CONFIG, ("branches",), 2)
    (folder / "other.yaml").write_text("extends: config.yaml\npreset: reference\n")
    base, other = load_config(folder / CONFIG), load_config(folder / "other.yaml")
    assert other.config.mesh_levels == base.config.mesh_levels
    (setting,) = other.settings("pressure_volume").values()
    assert (setting.mesh.level, setting.engine) == ("fine", "newton"), "a preset takes the place of what it stands for"
    assert other.branches_of(other.studies["pressure_volume"]) == 1
    (folder / "other.yaml").write_text("extends: config.yaml\nlimits: {jump: 0.5}\n")
    assert load_config(folder / "other.yaml").branches_of(other.studies["pressure_volume"]) == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("extends: other.yaml", "other.yaml: extends"),
        ("extends: ../config.yaml", "other.yaml: extends"),
        ("extends: none.yaml", "none.yaml: (file)"),
        ("extends: [config.yaml]", "other.yaml: extends"),
        ("extends: config.yaml\npreset: exact", "other.yaml: preset"),
        ("extends: config.yaml\npreset: standard\nmesh: {level: fine}", "other.yaml: preset"),
    ],
)
def test_a_configuration_that_cannot_extend_another_is_refused(folder, text, message):
    (folder / "other.yaml").write_text(text)
    with pytest.raises(ConfigError) as error:
        load_config(folder / "other.yaml")
    assert message in str(error.value)


def test_a_mistake_in_the_configuration_that_is_extended_names_that_file(folder):
    edit(folder / CONFIG, ("colour",), "red")
    (folder / "other.yaml").write_text("extends: config.yaml")
    with pytest.raises(ConfigError, match=r"config\.yaml: colour"):
        load_config(folder / "other.yaml")


def test_a_preset_may_ask_for_branches_unless_a_study_does(folder):
    edit(folder / CONFIG, ("presets", "standard"), {"branches": 3})
    edit(folder / STUDY, ("preset",), "standard")
    loaded = load_config(folder / CONFIG)
    assert loaded.branches_of(loaded.studies["pressure_volume"]) == 3
    assert loaded.content("pressure_volume")["study"]["branches"] == 3
    edit(folder / STUDY, ("branches",), 2)
    loaded = load_config(folder / CONFIG)
    assert loaded.branches_of(loaded.studies["pressure_volume"]) == 2


def test_a_preset_of_the_configuration_is_that_of_studies_that_name_none(folder):
    edit(folder / CONFIG, ("preset",), "reference")
    assert "preset = 'reference': expected no mesh, numerics beside it" in str(error_of(folder))
    for key in ("mesh", "numerics"):
        edit(folder / CONFIG, (key,), DELETE)
    loaded = load_config(folder / CONFIG)
    setting = loaded.settings("pressure_volume")[""]
    assert (setting.mesh.level, setting.preset, setting.engine) == ("fine", "touching_finest", "newton")
    edit(folder / CONFIG, ("preset",), "exact")
    assert "preview, reference, shells, standard" in str(error_of(folder))
    edit(folder / CONFIG, ("presets",), {})
    assert "no presets" in str(error_of(folder))


def test_the_same_setting_by_a_preset_and_by_its_parts_is_the_same_case(folder):
    edit(folder / STUDY, ("preset",), "preview")
    named = study_cases(load_config(folder / CONFIG), "pressure_volume")
    edit(folder / STUDY, ("preset",), DELETE)
    edit(folder / STUDY, ("engine",), "newton")
    assert [c.case_id for c in study_cases(load_config(folder / CONFIG), "pressure_volume").values()] == [
        c.case_id for c in named.values()
    ]


# --------------------------------------------------------------------------------------------------------------------
# what is asked for, and what is left out

BROKEN = {"colour": "red"}


def add(folder, name, **changes):
    """Another study like the first one."""
    data = yaml.safe_load((folder / STUDY).read_text()) | changes
    (folder / f"studies/{name}.yaml").write_text(yaml.safe_dump(data))


def test_a_broken_study_that_nothing_asks_for_is_left_out_with_the_same_message(folder):
    add(folder, "pie", **BROKEN)
    project = load_config(folder / CONFIG, ["pressure_volume"])
    assert list(project.studies) == ["pressure_volume"]
    with pytest.raises(ConfigError) as error:
        load_config(folder / CONFIG, ["pie"])
    (warning,) = project.warnings
    assert warning.endswith(str(error.value))
    assert "pie" in warning
    for asked in ([ALL], ["pressure_volume", "nobody", "results/cases/x/status.json"], []):
        assert list(load_config(folder / CONFIG, asked).broken) == ["studies/pie"]
    with pytest.raises(ConfigError, match=r"pie\.yaml: colour"):
        project.require(["pressure_volume", "pie"], "config.yaml", "limo check")
    with pytest.raises(ConfigError, match=r"pie\.yaml: colour"):
        project.studies["pie"]
    with pytest.raises(KeyError):
        project.studies["nobody"]


def test_what_the_configuration_runs_is_asked_for_where_nothing_else_is(folder):
    edit(folder / STUDY, ("colour",), "red")
    add(folder, "sound", colour="red")
    edit(folder / "studies/sound.yaml", ("colour",), DELETE)
    with pytest.raises(ConfigError, match="colour"):
        load_config(folder / CONFIG, [ALL])
    assert list(load_config(folder / CONFIG, ["sound"]).studies) == ["sound"]


def test_a_broken_device_breaks_its_studies_and_no_others(folder):
    add(folder, "small", device="mini_limo", figures=[])
    add(folder, "mixed", variants={"one": {}, "other": {"device": "mini_limo"}}, figures=[])
    edit(folder / "devices/mini_limo.yaml", ("patern",), {})
    project = load_config(folder / CONFIG, [ALL])
    assert list(project.studies) == ["pressure_volume"]
    assert set(project.broken) == {"devices/mini_limo", "studies/small", "studies/mixed"}
    assert len(project.warnings) == 1, "one mistake, one message"
    for name in ("small", "mixed"):
        with pytest.raises(ConfigError, match=r"mini_limo\.yaml: patern"):
            load_config(folder / CONFIG, [name])
    with pytest.raises(ConfigError, match=r"mini_limo\.yaml: patern"):
        project.require_device("mini_limo", "limo pattern", "DEVICE", "limo pattern limo 6")
    with pytest.raises(ConfigError, match="one of: limo"):
        project.require_device("nobody", "limo pattern", "DEVICE", "limo pattern limo 6")


# --------------------------------------------------------------------------------------------------------------------
# changes of the pattern

NEAR = {"seams": {"fractions": {10: [0.4, 1.2]}}}


def test_a_study_and_its_variants_change_keys_of_the_pattern(folder):
    variants = {"as_it_is": {}, "long": {"pattern": {"length": 140.0}}, "near": {"pattern": NEAR}}
    edit(folder / STUDY, ("variants",), variants)
    edit(folder / STUDY, ("pattern",), {"width_scale": 0.95})
    project = load_config(folder / CONFIG, strict=True)
    own, settings = project.devices["limo"].pattern, project.settings("pressure_volume")
    found = {name: settings[name].device.pattern for name in variants}
    assert {name: p.width_scale for name, p in found.items()} == dict.fromkeys(variants, 0.95)
    assert found["long"].length == 140.0
    assert found["near"].seams.fractions == own.seams.fractions | {10: [0.4, 1.2]}, "other numbers of pouches stay"
    assert found["as_it_is"].outline == own.outline
    cases = study_cases(project, "pressure_volume")
    assert len({case.mesh_id for case in cases.values()}) == 3


def test_a_study_without_changes_of_the_pattern_is_named_as_ever(folder):
    project = load_config(folder / CONFIG, strict=True)
    assert "pattern" not in project.content("pressure_volume")["study"]
    edit(folder / STUDY, ("pattern",), {"length": 140.0})
    assert load_config(folder / CONFIG, strict=True).content("pressure_volume")["study"]["pattern"] == {"length": 140.0}


@pytest.mark.parametrize(
    ("pattern", "key", "words"),
    [
        ({"seams": {"fractions": {10: [0.5, 1.9]}}}, "pattern.seams.fractions.10", "stay inside it"),
        ({"seams": {"fractions": {10: [0.5]}}}, "pattern.seams.fractions", "for 10 pouches 2 seam(s)"),
        ({"lenght": 140.0}, "pattern.lenght", "no such key"),
        ({"length": -1.0}, "pattern.length", "greater than or equal to 1"),
    ],
)
def test_a_changed_pattern_that_cannot_be_is_a_mistake_of_the_study(folder, pattern, key, words):
    edit(folder / STUDY, ("pattern",), pattern)
    error = error_of(folder)
    assert error.key == key
    assert words in str(error)
    assert "pressure_volume.yaml" in str(error)


def test_the_stress_test_of_a_broken_device_is_left_out(folder):
    add(folder, "small", device="mini_limo", figures=[])
    edit(folder / CONFIG, ("studies",), ["small"])
    edit(folder / "devices/limo_2025.yaml", ("patern",), {})
    edit(folder / CONFIG, ("scaling", "device"), "limo_2025")
    edit(folder / CONFIG, ("stress_test", "device"), "limo_2025")
    project = load_config(folder / CONFIG, [ALL])
    assert (project.config.stress_test, project.config.scaling) == (None, None)
    with pytest.raises(ConfigError, match=r"limo_2025\.yaml: patern"):
        project.require_sound("stress_test")
    edit(folder / CONFIG, ("stress_test", "device"), "nobody")
    with pytest.raises(ConfigError, match=r"config\.yaml: stress_test\.device"):
        load_config(folder / CONFIG)


def test_strictness_tells_of_every_mistake_at_once(folder):
    add(folder, "pie", **BROKEN)
    add(folder, "cake", device="nobody")
    edit(folder / AIRBAG, ("colour",), "red")
    with pytest.raises(LimoError) as error:
        load_config(folder / CONFIG, strict=True)
    lines = str(error.value).splitlines()
    assert len(lines) == 3
    for name in ("pie.yaml: colour", "cake.yaml: device", "classical.yaml: colour"):
        assert sum(name in line for line in lines) == 1


def test_no_study_can_have_the_name_of_a_rule(root):
    files = [root / "Snakefile", *(root / "workflow/rules").glob("*.smk")]
    rule = re.compile(r"^(?:rule|checkpoint) (\w+):", re.MULTILINE)
    assert {name for file in files for name in rule.findall(file.read_text())} == set(RULES)


@pytest.mark.parametrize(
    ("words", "asked"),
    [
        ("", [ALL]),
        ("-n --cores 2 --config file=config/config.yaml", [ALL]),
        ("-n pie -- pressure_volume", ["pie", "pressure_volume"]),
        ("paper pie", ["a", "b", "pie"]),
        ("all results/studies/cake/figures/x.png", [ALL, "cake"]),
        ("results/cases/x/status.json", []),
        ("material --cores 2", []),
        ("nobody", [ALL]),
    ],
)
def test_studies_are_asked_for_by_their_names_their_files_and_rules(folder, words, asked):
    add(folder, "pie", **BROKEN)
    assert asked_studies(words.split(), folder / CONFIG, Results(Path("results")), {"paper": ["a", "b"]}) == asked


# --------------------------------------------------------------------------------------------------------------------
# what a study is for


def test_a_role_has_a_subject_and_is_taken_once(folder):
    add(folder, "finest", role="reference")
    assert "role and subject together" in error_of(folder).expected
    add(folder, "finest", role="reference", subject="np10")
    assert load_config(folder / CONFIG, strict=True).studies["finest"].role == "reference"
    add(folder, "finest_too", role="reference", subject="np10")
    error = error_of(folder)
    assert (error.key, error.value) == ("role", "reference")
    assert str(folder / "studies/finest.yaml") in error.expected


@pytest.mark.parametrize("name", ["reference_np10", "accuracy_np10"])
def test_a_role_in_a_name_alone_is_refused_with_the_new_spelling(folder, name):
    role, _, subject = name.partition("_")
    add(folder, name)
    if role != "reference":
        assert name in load_config(folder / CONFIG, strict=True).studies, "without a reference it had no role"
        add(folder, "finest", role="reference", subject="np10")
    error = error_of(folder)
    assert f"role: {role} and subject: {subject} as keys" in error.expected
    assert error.file == str(folder / f"studies/{name}.yaml")
    add(folder, name, **yaml.safe_load(error.example.replace(" and ", "\n")))
    assert load_config(folder / CONFIG, strict=True).studies[name].subject == "np10"


def test_what_a_study_is_for_is_no_part_of_its_dataset(folder):
    before = load_config(folder / CONFIG).content("pressure_volume")
    edit(folder / STUDY, ("role",), "scatter")
    edit(folder / STUDY, ("subject",), "np10")
    assert load_config(folder / CONFIG).content("pressure_volume") == before


# --------------------------------------------------------------------------------------------------------------------
# the project


def test_a_project_does_not_change(folder):
    project = load_config(folder / CONFIG)
    with pytest.raises(AttributeError):
        project.builds = {"newton": "other"}
    for name in ("devices", "studies", "files", "airbags", "builds", "broken"):
        with pytest.raises(TypeError):
            getattr(project, name)["other"] = None
    other = project.with_builds({"calculix": "2.20"})
    assert (dict(project.builds), dict(other.builds)) == ({}, {"calculix": "2.20"})
    (before,), (after,) = (study_cases(p, "pressure_volume").values() for p in (project, other))
    assert (before.build, after.build) == ("", "2.20")


def test_each_study_is_resolved_once(folder, monkeypatch):
    calls = []
    resolve = config_project.setting_of
    for module in (config_project, config_checks):
        monkeypatch.setattr(module, "setting_of", lambda *parts: calls.append(parts) or resolve(*parts))
    add(folder, "many", variants={"plain": {}, "half": {"mesh": {"symmetry": "front_back"}}}, figures=[])
    project = load_config(folder / CONFIG).with_builds({"calculix": "2.20"})
    make_plan(project, folder)
    project.content("many")
    assert len(calls) == 3, "two variants and a study without"
    assert study_cases(project, "many") is study_cases(project, "many")


# --------------------------------------------------------------------------------------------------------------------
# schemas and examples


def sections(of: type[Section] = Section) -> list[type[Section]]:
    """All models of a section of a configuration file."""
    return [model for direct in of.__subclasses__() for model in (direct, *sections(direct))]


SECTIONS = [model for model in sections() if model.__module__.startswith("limo.")]


@pytest.mark.parametrize("name", list(json_schemas()))
def test_schema_file_is_the_one_the_models_generate(root, name):
    assert json.loads((root / "workflow/schemas" / name).read_text()) == json.loads(json.dumps(json_schemas()[name]))


KINDS = (("device", "devices"), ("study", "studies"), ("airbag", "airbags"), ("inference", "inferences"))


@pytest.mark.parametrize(("schema", "pattern"), [("config", "*.yaml"), *((kind, f"{folder}/*.yaml") for kind, folder in KINDS)])
def test_shipped_files_meet_their_schema(root, schema, pattern):
    files = list((root / "config").glob(pattern))
    assert files
    for file in files:
        jsonschema.validate(json.loads(json.dumps(read_yaml(file))), json_schemas()[f"{schema}.schema.json"])


def test_configurations_that_costs_are_measured_with_are_valid(root, monkeypatch):
    """Those of ``make performance``, each beside its own devices and studies."""
    monkeypatch.chdir(root)
    files = re.findall(r"\w+:(config/\S+\.yaml)", (root / "Makefile").read_text())
    assert {"config/levers/config.yaml", "config/stock/config.yaml"} < set(files)
    for file in files:
        load_config(file)


FIELDS = [(m, n) for m in SECTIONS for n in m.model_fields]


@pytest.mark.parametrize(("model", "name"), FIELDS, ids=[f"{m.__name__}.{n}" for m, n in FIELDS])
def test_every_field_is_described_and_its_example_is_valid(model, name):
    field: FieldInfo = model.model_fields[name]
    kinds = [field.annotation, *getattr(field.annotation, "__args__", ())]
    if any(isinstance(kind, type) and issubclass(kind, Section) for kind in kinds):
        return  # a section describes itself, field by field
    assert field.description
    assert not re.search(r"\b(TODO|FIXME)\b", field.description)
    for example in field.examples or ():
        value = TypeAdapter(Annotated[field.annotation, field]).validate_python(example)
        assert value is not None


def test_a_misspelt_key_gets_the_example_of_the_one_that_is_spelt_most_like_it(root, tmp_path):
    copy = shutil.copytree(root / "config", tmp_path / "config")
    file = copy / "studies" / "buckling.yaml"
    file.write_text(file.read_text() + "actuation_presure_max: 60\n")
    with pytest.raises(ConfigError, match=r"actuation_presure_max.*no such key.*for example actuation_pressure_max: "):
        load_config(copy / "config.yaml", strict=True)


def test_contents_are_the_same_where_an_older_one_lacks_what_has_its_default(loaded):
    content = loaded.content("fatigue")
    older = json.loads(json.dumps(content))
    del older["settings"][""]["numerics"]["contact"]["coupling"], older["fatigue"]["mean_correction"], older["study"]["variants"]
    assert same_content(content, older)
    assert same_content(older, content)
    other = json.loads(json.dumps(older))
    other["settings"][""]["numerics"]["contact"]["coupling"] = "all"
    assert not same_content(content, other)
    gone = json.loads(json.dumps(older)) | {"study": older["study"] | {"no_longer": 1}}
    assert not same_content(content, gone), "a key that means nothing any more"
    assert not same_content(content, {"study": older["study"]})
