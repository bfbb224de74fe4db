"""Commands on studies: check, sweep, jobs, status, table, new-study."""

from __future__ import annotations

import argparse
from pathlib import Path

from limo.terminal.commands import arguments
from limo.terminal.commands.documents import write_page_of


def add_check(commands: arguments.Commands) -> None:
    """``limo check``."""
    made = commands.add(
        _check,
        "check",
        "validate the configuration, say what is solved and how long the rest will take, run nothing",
        "",
        "pressure_volume afterload --cores 8",
        "afterload --draw svg --mesh",
        "afterload --on slurm",
    )
    arguments.studies(made)
    made.add_argument(
        "--draw", nargs="?", const="png", choices=("png", "svg"), help="draw the flat patterns into results/patterns (png)"
    )
    made.add_argument("--mesh", action="store_true", help="with --draw: draw the mesh, too, which takes some seconds each")
    arguments.config(made)
    arguments.results(made)
    arguments.cores(made)
    arguments.cluster(made, "say what a sweep there would ask for")


def _check(chosen: argparse.Namespace) -> None:
    from limo.terminal.tables import plan_table

    print(plan_table(chosen.config, chosen.studies, chosen.results, chosen.cores))
    if chosen.on:
        from limo.terminal.cluster import check_on

        print(check_on(chosen.on, chosen.config, chosen.studies, chosen.results))
    if chosen.draw:
        from limo.terminal.drawing import draw_studies

        for file in draw_studies(chosen.config, chosen.studies, chosen.results, chosen.draw, chosen.mesh):
            print(f"  drawn: {file}")


def add_new_study(commands: arguments.Commands) -> None:
    """``limo new-study``."""
    made = commands.add(
        _new_study, "new-study", "write a commented study to start from", "thick_fabric", "small --device mini_limo"
    )
    made.add_argument("name", metavar="NAME", help="name of the study and of its file in config/studies")
    made.add_argument("--device", default="limo", metavar="DEVICE", help="a file in config/devices (default: %(default)s)")
    arguments.config(made)


def _new_study(chosen: argparse.Namespace) -> None:
    from limo.terminal.scaffold import new_study

    file = new_study(chosen.config, chosen.name, chosen.device)
    print(f"{file}: edit it, then: limo check {chosen.name} --draw; limo sweep {chosen.name}")


def add_status(commands: arguments.Commands) -> None:
    """``limo status``."""
    made = commands.add(
        _status,
        "status",
        "show where the cases of a running or finished sweep are",
        "",
        "--watch",
        "afterload --json",
        "--watch 10 > sweep.txt",
    )
    arguments.studies(made, "those that the configuration runs; cases of others while they are solved")
    made.add_argument(
        "--watch", nargs="?", type=float, const=2.0, metavar="SECONDS", help="show it again every so many seconds (2)"
    )
    made.add_argument("--json", action="store_true", help="print JSON for machines")
    arguments.config(made)
    arguments.results(made)
    arguments.cores(made)


def _status(chosen: argparse.Namespace) -> int:
    import json

    from limo.terminal import monitor
    from limo.terminal.status import open_sweep, to_plain

    sweep = open_sweep(chosen.config, chosen.studies, chosen.results, chosen.cores)
    if chosen.json:
        statuses = sweep.look()
        print(json.dumps(to_plain(sweep, statuses), indent=2))
    elif chosen.watch is not None:
        statuses = monitor.watch(sweep, monitor.console(), max(chosen.watch, 0.1))
    else:
        statuses = monitor.show(sweep, monitor.console())
    return arguments.FAILED if monitor.failed(statuses) else arguments.DONE


def add_sweep(commands: arguments.Commands) -> None:
    """``limo sweep``."""
    made = commands.add(
        _sweep,
        "sweep",
        "run snakemake on studies and show their cases meanwhile",
        "pressure_volume",
        "afterload compliance --cores 8 -- --rerun-incomplete",
        "--on slurm afterload",
    )
    arguments.studies(made, "those that the configuration runs")
    arguments.config(made)
    arguments.cores(made)
    arguments.cluster(made, "submit it to a cluster instead of solving here")
    made.add_argument(
        "--left", choices=("refuse", "adopt", "cancel"), default="refuse",
        help="with --on: what happens to jobs that an earlier sweep left: adopt waits for their results (default: %(default)s)",
    )  # fmt: skip
    made.set_defaults(results=Path("results"))


def _sweep(chosen: argparse.Namespace) -> int:
    from limo.terminal import monitor
    from limo.terminal.status import open_sweep

    cores, how = chosen.cores, ["--cores", str(chosen.cores)]
    if chosen.on:
        from limo.terminal.cluster import ready

        profile = ready(chosen.on, chosen.left)
        cores, how = profile.jobs, ["--workflow-profile", str(profile.folder)]
    sweep = open_sweep(chosen.config, chosen.studies, chosen.results, cores)
    well = monitor.run_sweep(sweep, chosen.config, chosen.studies, [*how, *chosen.options], monitor.console())
    if not {"-n", "--dry-run", "--dryrun"} & {*chosen.options}:
        write_page_of(chosen)
    return arguments.DONE if well else arguments.FAILED


def add_jobs(commands: arguments.Commands) -> None:
    """``limo jobs``."""
    made = commands.add(
        _jobs,
        "jobs",
        "list this folder's jobs on Slurm, wait for those of a sweep that was killed, or end them",
        "",
        "adopt",
        "cancel",
    )
    made.add_argument(
        "doing", nargs="?", choices=("list", "adopt", "cancel"), default="list",
        help="adopt: wait until all have ended, their results count; cancel: end them (default: %(default)s)",
    )  # fmt: skip


def _jobs(chosen: argparse.Namespace) -> None:
    from limo.terminal import cluster

    print({"list": cluster.list_jobs, "adopt": cluster.adopt_jobs, "cancel": cluster.cancel_jobs}[chosen.doing](Path.cwd()))


def add_table(commands: arguments.Commands) -> None:
    """``limo table``."""
    made = commands.add(_table, "table", "print the results of a study", "results/studies/pressure_volume/study.nc")
    made.add_argument("dataset", type=Path, help="study.nc of a study")


def _table(chosen: argparse.Namespace) -> None:
    from limo.terminal.tables import study_table

    print(study_table(chosen.dataset))
