"""A broken study or device that nothing asked for uses is a warning; asked for, it is the one message."""

from __future__ import annotations

import pytest


def said(done) -> str:
    return done.stdout + done.stderr


@pytest.fixture
def broken(project):
    """The tiny study, one with an unknown key, and one of a device without a fabric."""
    project.study("pie", colour="red")
    project.study("small", device="mini_limo")
    project.edit("devices/mini_limo.yaml", lambda device: device.pop("material"))
    return project


def test_the_others_are_planned_with_one_warning_a_mistake(broken):
    assert broken.planned()["solve_case"] == 2
    assert broken.planned("tiny")["solve_case"] == 2
    text = said(broken.snakemake("-n"))
    assert text.count("pie.yaml: colour = 'red'") == 1
    assert text.count("mini_limo.yaml: material") == 1
    assert "left out, as nothing that was asked for uses it: mini_limo, small" in text


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("pie", "pie.yaml: colour = 'red'"),
        ("results/studies/pie/study.nc", "pie.yaml: colour = 'red'"),
        ("small", "mini_limo.yaml: material"),
        ("accuracy", "pie.yaml: colour = 'red'"),
    ],
)
def test_asking_for_a_broken_one_says_what_is_wrong(broken, target, message):
    done = broken.snakemake(target, "-n")
    assert done.returncode != 0
    assert message in said(done)
    assert "Traceback" not in said(done)
    assert not (broken.folder / "results").exists(), "before anything runs"


def test_a_broken_study_that_the_configuration_runs_is_refused_unless_others_are_asked_for(project):
    project.study("sound")
    project.edit("studies/tiny.yaml", lambda study: study.update(colour="red"))
    assert project.snakemake("-n").returncode != 0
    assert project.planned("sound")["solve_case"] == 2
