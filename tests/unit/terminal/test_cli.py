"""The command line: its help, exit codes, completion, and new studies."""

import os
import pty
import select
import shlex
import shutil
import subprocess
import sys

import pytest

from limo.cases.grid import study_cases
from limo.config.load import RULES, load_config
from limo.terminal.cli import main, make_parser, split
from limo.terminal.completion import script

COMMANDS = (
    "check", "new-study", "pattern", "status", "sweep", "show", "compare", "table", "beat", "benchmark", "performance", "clean",
    "completion", "paper-check", "gallery", "page", "accuracy", "reliability", "import-pattern", "docs", "tensile", "measured",
    "derive-outline", "jobs", "infer",
)  # fmt: skip


@pytest.fixture
def project(root, tmp_path, monkeypatch):
    """A copy of the configuration, in whose folder the commands run."""
    shutil.copytree(root / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def help_of(*arguments):
    done = subprocess.run(
        [sys.executable, "-m", "limo.terminal.cli", *arguments, "--help"], capture_output=True, text=True, check=False
    )
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
        own, _ = split(words)
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
        f"{shlex.quote(sys.executable)} -m limo.terminal.cli check | head -1; exit ${{PIPESTATUS[0]}}",
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


SEPARATOR = "\v"  # argcomplete's


def ask(line, tmp_path, *options):
    """What ``limo`` answers a shell whose line is completed at its end, by argcomplete's protocol; and standard error."""
    file = tmp_path / "answer"
    asked = {
        "_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_STDOUT_FILENAME": str(file),
        "_ARGCOMPLETE_SUPPRESS_SPACE": "1", "_ARGCOMPLETE_SHELL": "bash",
    }  # fmt: skip
    command = [sys.executable, *options, "-m", "limo.terminal.cli"]
    done = subprocess.run(command, env=os.environ | asked, capture_output=True, text=True, check=True)
    assert done.stdout == ""
    return {word for word in file.read_text().split(SEPARATOR) if word}, done.stderr


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("", set(COMMANDS)),
        ("sta", {"status"}),
        ("status --w", {"--watch"}),
        ("status press", {"pressure_volume"}),
        ("status --cores 8 press", {"pressure_volume"}),
        ("status pressure_volume press", set()),
        ("status --cores ", set()),
        (
            "check --draw s",
            {
                "svg",
                "stress",
                "strain_paths",
                "symmetry",
                "scatter_np4",
                "scatter_np8",
                "shells_np4",
                "seam_positions",
                "surface",
                "surface_mini",
                "syringe",
            },
        ),
        ("check --config conf", {"config/"}),
        ("pattern m", {"mini_limo"}),
        ("pattern limo --w", {"--width-scale"}),
        ("pattern limo 6 --dxf-version ", {"R2010", "R12"}),
        ("new-study x --device mini", {"mini_limo"}),
        ("import-pattern x.dxf --fabric mini", {"mini_limo"}),
        ("import-pattern x.dxf --half ", {"right", "left"}),
        ("show limo_np4", {"limo_np4_pv3.8"}),
        ("show limo_np4_pv3.8 limo_np4", set()),
        ("show --results copied limo", {"limo_np6_pv3.8"}),
        ("show --results nowhere limo", set()),
        ("performance rec", {"record"}),
        ("performance record --t", {"--table"}),
        ("completion z", {"zsh"}),
    ],
)
def test_words_are_completed(project, line, found):
    (project / "results/cases/limo_np4_pv3.8").mkdir(parents=True)
    (project / "copied/cases/limo_np6_pv3.8").mkdir(parents=True)
    assert ask(f"limo {line}", project)[0] == found


@pytest.mark.parametrize("line", ["limo ", "limo status ", "limo pattern ", "limo show "])
def test_the_tab_key_imports_nothing_heavy(project, line):
    (project / "results/cases/limo_np4_pv3.8").mkdir(parents=True)
    found, said = ask(line, project, "-X", "importtime")
    assert found
    imported = {row.rpartition("|")[2].strip() for row in said.splitlines() if row.startswith("import time:")}
    assert "argcomplete" in imported
    heavy = {"numpy", "pandas", "xarray", "pydantic", "yaml", "scipy", "matplotlib", "gmsh", "snakemake", "rich", "ezdxf"}
    assert not imported & heavy


@pytest.fixture
def shell(project):
    """Environment of a shell that finds ``limo``, without start-up files."""
    limo = project / "bin" / "limo"
    limo.parent.mkdir()
    limo.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m limo.terminal.cli "$@"\n')
    limo.chmod(0o755)
    return os.environ | {"PATH": f"{limo.parent}:{os.environ['PATH']}", "TERM": "dumb", "PS1": "$ "}


def test_bash_completes_with_the_script(shell):
    """As bash does it on the Tab key: it calls the function that the script registers, with the line so far."""
    lines = ['eval "$(limo completion bash)"', "complete -p limo"]
    for line in ("limo status press", "limo status "):
        lines += [f"COMP_LINE='{line}'; COMP_POINT=${{#COMP_LINE}}", "_python_argcomplete limo", "echo ${COMPREPLY[@]}"]
    done = subprocess.run(["bash", "-c", "\n".join(lines)], env=shell, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    registered, first, rest = done.stdout.splitlines()
    assert registered.endswith("-F _python_argcomplete limo")
    assert first == "pressure_volume"
    assert {"afterload", "compliance"} <= set(rest.split())


def test_the_tab_key_of_a_terminal_completes(shell):
    """A true bash in a terminal, and a true Tab."""
    outer, inner = pty.openpty()
    bash = subprocess.Popen(
        ["bash", "--norc", "--noprofile", "-i"], stdin=inner, stdout=inner, stderr=inner, env=shell, start_new_session=True
    )
    os.close(inner)
    try:
        os.write(outer, b'eval "$(limo completion bash)"; echo "ready"-"now"\n')
        assert await_text(outer, "ready-now")
        os.write(outer, b"limo pattern mi\t")
        assert await_text(outer, "limo pattern mini_limo ")
    finally:
        bash.kill()
        bash.wait()
        os.close(outer)


def await_text(terminal, wanted, patience=60.0):
    """Whether a terminal shows a text before nothing new has come for so many seconds."""
    shown = ""
    while wanted not in shown:
        if not select.select([terminal], [], [], patience)[0]:
            return False
        shown += os.read(terminal, 4096).decode()
    return True


@pytest.mark.parametrize("name", ["bash", "zsh"])
def test_the_script_of_a_shell_is_one(name):
    if not shutil.which(name):
        pytest.skip(f"no {name} on this machine")
    assert script(name).startswith("#compdef limo\n"), "by which zsh finds it in a folder of functions"
    assert subprocess.run([name, "-n"], input=script(name), text=True, check=False).returncode == 0
