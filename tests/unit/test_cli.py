"""The command line: its help, exit codes, completion, and new studies."""

import shutil
import subprocess
import sys

import pytest

from limo.case import study_cases
from limo.cli import _split, main, make_parser
from limo.completion import candidates, script
from limo.config import RULES, load_config

COMMANDS = (
    "check", "new-study", "pattern", "status", "sweep", "show", "compare", "table", "benchmark", "performance", "clean",
    "completion", "paper-check", "gallery", "page", "accuracy", "reliability", "tensile", "measured",
)  # fmt: skip


@pytest.fixture
def project(root, tmp_path, monkeypatch):
    """A copy of the configuration, in whose folder the commands run."""
    shutil.copytree(root / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def help_of(*arguments):
    done = subprocess.run([sys.executable, "-m", "limo.cli", *arguments, "--help"], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    return done.stdout


def test_help_lists_commands_and_exit_codes():
    said = help_of()
    assert all(name in said for name in COMMANDS)
    assert all(f"\n  {code} " in said for code in (0, 1, 2, 3, 130))


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_every_command_has_examples_that_parse(name):
    epilog = next(a for a in make_parser()._actions if a.choices).choices[name].epilog
    examples = [line.strip() for line in epilog.splitlines() if line.startswith(f"  limo {name}")]
    assert examples
    for example in examples:
        words = subprocess.run(
            ["bash", "-c", f"printf '%s\\n' {example.split('>')[0]}"], capture_output=True, text=True, check=True
        ).stdout.splitlines()[1:]
        own, _ = _split(words)
        assert make_parser().parse_args(own).command == name


def test_exit_codes_tell_mistakes_from_misuse(project, capsys):
    assert main(["check", "nowhere"]) == 1
    assert "nowhere" in capsys.readouterr().err
    with pytest.raises(SystemExit) as caught:
        main(["nonsense"])
    assert caught.value.code == 2
    assert main(["show", "np4"]) == 1
    for command in (["status"], ["sweep"], ["performance", "record", "levers"]):
        assert main([*command, "nowhere"]) == 1
        assert "STUDY = 'nowhere': expected one of: " in capsys.readouterr().err
    assert main(["pattern", "limo", "5"]) == 1


def test_a_reader_that_goes_away_is_no_error(project):
    done = subprocess.run(
        f"{sys.executable} -m limo.cli check | head -1; exit ${{PIPESTATUS[0]}}",
        shell=True, executable="/bin/bash", capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "Traceback" not in done.stderr
    assert "BrokenPipe" not in done.stderr


# --------------------------------------------------------------------------------------------------------------------
# new studies


@pytest.mark.parametrize("device", ["limo", "mini_limo"])
def test_a_new_study_is_valid_as_it_is(project, device, capsys):
    assert main(["new-study", "mine", "--device", device]) == 0
    assert "limo sweep mine" in capsys.readouterr().out
    loaded = load_config()
    assert loaded.studies["mine"].device == device
    assert len(study_cases(loaded, "mine")) == 2


def test_every_key_that_a_new_study_offers_is_valid_too(project):
    main(["new-study", "mine"])
    file = project / "config/studies/mine.yaml"
    text = file.read_text()
    offered = [
        line
        for line in text.splitlines()
        if (line.lstrip().startswith("# ") and ": " in line and "[" in line) or "# engine:" in line
    ]
    assert len(offered) >= 7
    for line in offered:
        file.write_text(text.replace(line, line.replace("# ", "", 1)))
        changed = load_config().studies["mine"]
        file.write_text(text)
        key = line.replace("#", "").split(":")[0].strip()
        plain = load_config().studies["mine"]
        assert (
            key
            in (changed.axes.model_fields_set | changed.model_fields_set) - plain.axes.model_fields_set - plain.model_fields_set
        )


@pytest.mark.parametrize("name", ["pressure_volume", "2fast", "a b", "../escape", RULES[0]])
def test_names_that_are_taken_or_cannot_be_write_nothing(project, name, capsys):
    before = {p: p.read_bytes() for p in project.rglob("*") if p.is_file()}
    assert main(["new-study", name]) == 1
    assert name in capsys.readouterr().err
    assert {p: p.read_bytes() for p in project.rglob("*") if p.is_file()} == before
    assert main(["new-study", "mine", "--device", "nowhere"]) == 1


# --------------------------------------------------------------------------------------------------------------------
# completion


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ([""], set(COMMANDS)),
        (["sta"], {"status"}),
        (["status", "--w"], {"--watch"}),
        (["status", "press"], {"pressure_volume"}),
        (["status", "--cores", "8", "press"], {"pressure_volume"}),
        (["status", "--cores", ""], set()),
        (["check", "--draw", ""], {"png", "svg"}),
        (["pattern", "m"], {"mini_limo"}),
        (["pattern", "limo", "--w"], {"--width-scale"}),
        (["new-study", "x", "--device", "mini"], {"mini_limo"}),
        (["show", "limo_np4"], {"limo_np4_pv3.8"}),
        (["performance", "rec"], {"record"}),
        (["performance", "record", "--t"], {"--table"}),
        (["completion", "z"], {"zsh"}),
    ],
)
def test_words_are_completed(project, words, found):
    (project / "results/cases/limo_np4_pv3.8").mkdir(parents=True)
    assert set(candidates(make_parser(), words)) == found


def test_bash_completes_with_the_script(project, tmp_path):
    """As the Tab key does it: bash calls the function with the words so far."""
    limo = tmp_path / "bin" / "limo"
    limo.parent.mkdir()
    limo.write_text(f'#!/bin/sh\nexec {sys.executable} -m limo.cli "$@"\n')
    limo.chmod(0o755)
    lines = [
        f"PATH={limo.parent}:$PATH",
        script("bash"),
        "COMP_WORDS=(limo status press); COMP_CWORD=2; _limo",
        'printf "%s\\n" "${COMPREPLY[@]}"',
        "COMP_WORDS=(limo status ''); COMP_CWORD=2; _limo",
        'printf "%s\\n" "${COMPREPLY[@]}"',
    ]
    done = subprocess.run(["bash", "-c", "\n".join(lines)], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    first, *rest = done.stdout.split()
    assert first == "pressure_volume"
    assert {"afterload", "compliance"} <= set(rest)


def test_the_script_of_zsh_is_zsh():
    if not shutil.which("zsh"):
        pytest.skip("no zsh on this machine")
    assert subprocess.run(["zsh", "-n"], input=script("zsh"), text=True, check=False).returncode == 0
