"""Commands that write documents from results and kept data."""

from __future__ import annotations

import argparse
from pathlib import Path

from limo.errors import LimoError
from limo.terminal.commands import arguments


def add_page(commands: arguments.Commands) -> None:
    """``limo page``."""
    made = commands.add(
        write_page_of,
        "page",
        "gather what is there of all studies into results/index.html, a page to look at in a browser",
        "",
        "--results copied/results",
    )
    arguments.config(made)
    arguments.results(made)


def write_page_of(chosen: argparse.Namespace) -> None:
    from limo.config.builds import warn_of_broken
    from limo.config.load import load_config
    from limo.page.write import write_page

    project = load_config(chosen.config)
    warn_of_broken(project)
    print(write_page(chosen.results, project.studies))


def add_performance(commands: arguments.Commands) -> None:
    """``limo performance``."""
    made = commands.add(
        _performance,
        "performance",
        "keep measured costs in a table, and write the report of it",
        "record levers --config config/levers/config.yaml",
        "report > docs/performance.md",
    )
    doing = made.add_subparsers(dest="doing", required=True)
    recorded = doing.add_parser("record", help="put the costs of a configuration's solved cases into the table")
    recorded.add_argument("batch", help="name of the runs that were measured together, for example levers")
    arguments.studies(recorded, "those the configuration runs")
    arguments.config(recorded)
    arguments.results(recorded)
    timed = doing.add_parser("overhead", help="time a sweep with nothing to do, and the planning of a thousand cases")
    arguments.config(timed)
    compared = doing.add_parser("beside", help="compare imports, planning and help with another checkout; both are set up")
    compared.add_argument("other", type=Path, metavar="CHECKOUT", help="folder of the other checkout")
    compared.add_argument("--tests", action="store_true", help="time `make test` in both instead, once")
    compared.add_argument("--solve", action="store_true", help="time what a solve by engine newton imports instead, part by part")
    swept = doing.add_parser(
        "cluster", help="measure what a sweep on a cluster takes beside its solves; its node is this machine"
    )
    swept.add_argument("--on", default="slurm", metavar="CLUSTER", help="a folder in workflow/profiles (default: %(default)s)")
    swept.add_argument("--swept", type=int, default=1000, metavar="N", help="cases of the sweep, 0: none (default: %(default)s)")
    swept.add_argument("--planned", type=int, default=1000, metavar="N", help="cases of the rest (default: %(default)s)")
    printed = doing.add_parser("report", help="print the report")
    for part in (swept, printed):
        part.add_argument("--cluster", type=Path, default=Path("docs/data/cluster.csv"), help="its table (default: %(default)s)")
    for part in (recorded, printed):
        part.add_argument(
            "--table", type=Path, default=Path("docs/data/performance.csv"), help="the table (default: %(default)s)"
        )
    for part in (compared, printed):
        part.add_argument("--entry", type=Path, default=Path("docs/data/entry.csv"), help="its table (default: %(default)s)")
    peer = Path("docs/data/peer.csv")
    printed.add_argument("--peer", type=Path, default=peer, help="table of scripts/peer/kratos.py (default: %(default)s)")
    before = Path("docs/data/before.csv")
    printed.add_argument("--before", type=Path, default=before, help="table of scripts/peer/before.py (default: %(default)s)")
    for part in (timed, printed):
        part.add_argument(
            "--overhead", type=Path, default=Path("docs/data/overhead.csv"), help="its table (default: %(default)s)"
        )


def _performance(chosen: argparse.Namespace) -> None:
    from limo.reports import cluster
    from limo.reports.before import read_before
    from limo.reports.entry import compare, compare_solve_imports, compare_tests, entry_table, keep, read_entry
    from limo.reports.overhead import read_overhead, record_overhead
    from limo.reports.peer import read_peer
    from limo.reports.performance import read_measurements, record_batch, report

    if chosen.doing == "record":
        print(record_batch(chosen.config, chosen.batch, chosen.studies, chosen.results, chosen.table))
    elif chosen.doing == "overhead":
        print(record_overhead(Path(chosen.config), chosen.overhead))
    elif chosen.doing == "beside":
        measure = compare_tests if chosen.tests else compare_solve_imports if chosen.solve else compare
        rows = measure(Path.cwd(), chosen.other.resolve())
        keep(rows, chosen.entry)
        print(entry_table(rows))
    elif chosen.doing == "cluster":
        rows = cluster.measure(chosen.on, chosen.swept, chosen.planned)
        print(cluster.cluster_table(cluster.keep(rows, chosen.cluster)))
    else:
        measured = read_overhead(chosen.overhead), read_entry(chosen.entry), cluster.read_cluster(chosen.cluster)
        beside = read_peer(chosen.peer), read_before(chosen.before)
        print(report(read_measurements(chosen.table), *measured, *beside), end="")


def add_paper_check(commands: arguments.Commands) -> None:
    """``limo paper-check``."""
    made = commands.add(
        _paper_check,
        "paper-check",
        "test the paper's statements on the datasets of the studies; write the table and a page of it",
        "",
        "--data docs/gallery/data",
    )
    made.add_argument("--data", type=Path, default=Path("results/studies"), help="folder of datasets (default: %(default)s)")
    made.add_argument(
        "--beside", type=arguments.named_path, action="append", default=[], metavar="[NAME=]DATA",
        help="datasets of another model, whose verdicts get a column of this name; may be given several times",
    )  # fmt: skip
    made.add_argument(
        "--inference", type=Path, help="table of an inference (limo infer --table) that used some statements and held others out"
    )
    made.add_argument("--table", type=Path, default=Path("results/paper_check.csv"), help="default: %(default)s")
    made.add_argument("--page", type=Path, default=Path("results/paper_check.md"), help="default: %(default)s")


def _paper_check(chosen: argparse.Namespace) -> None:
    from limo.reports.paper_check import write_check

    verdicts = write_check(chosen.data, chosen.table, chosen.page, dict(chosen.beside), chosen.inference)
    print(f"{verdicts}: {chosen.table}, {chosen.page}")


def add_gallery(commands: arguments.Commands) -> None:
    """``limo gallery``."""
    made = commands.add(
        _gallery,
        "gallery",
        "keep the datasets of studies in the gallery, and draw its figures and its page from them",
        "",
        "afterload compliance",
        "--redraw",
        "--set standard --config config/standard.yaml",
        "--exploration best_heart",
    )
    arguments.studies(made, "all that are gathered")
    made.add_argument("--redraw", action="store_true", help="draw what the gallery holds and copy nothing into it")
    made.add_argument("--to", type=Path, default=Path("docs/gallery"), metavar="FOLDER", help="default: %(default)s")
    made.add_argument(
        "--set", dest="part", default="", metavar="NAME",
        help="a set beside the first one, in a folder of this name: curves and pictures, without surfaces; it grows by the "
        "cases that are solved",
    )  # fmt: skip
    made.add_argument("--exploration", metavar="NAME", help="an exploration instead of studies, in a folder of its name")
    made.add_argument(
        "--lacking", action="store_true", help="print the files that snakemake is to make for the set, and do nothing else"
    )
    arguments.config(made)
    arguments.results(made)


def _gallery(chosen: argparse.Namespace) -> None:
    from limo.reports.gallery import lacking_of_set, make_gallery

    if chosen.exploration:
        from limo.reports.exploration import keep_exploration
        from limo.store.results import Results

        for file in keep_exploration(chosen.exploration, Results(chosen.results), chosen.to):
            print(file)
        return
    where = chosen.config, chosen.studies, chosen.results, chosen.to, chosen.part
    for file in lacking_of_set(*where) if chosen.lacking else make_gallery(*where, redraw=chosen.redraw):
        print(file)


def add_reliability(commands: arguments.Commands) -> None:
    """``limo reliability``."""
    made = commands.add(
        _reliability,
        "reliability",
        "measure how reliable solves are, and renew the tables of docs/reliability.md",
        "record",
        "paths newton --kinds same branch",
        "report docs/reliability.md",
    )
    doing = made.add_subparsers(dest="doing", required=True)
    recorded = doing.add_parser("record", help="keep what the stress test found so far: the cases that are solved")
    arguments.config(recorded)
    arguments.results(recorded)
    paths = doing.add_parser("paths", help="solve one case again, perturbed, by other builds and on other meshes")
    paths.add_argument("engine", choices=("calculix", "newton"), help="what solves it")
    paths.add_argument(
        "--kinds", nargs="+", choices=("same", "build", "branch", "mesh"), default=["same", "build", "branch", "mesh"],
        help="which runs (default: all)",
    )  # fmt: skip
    paths.add_argument("--to", type=float, default=60.0, metavar="KPA", help="highest actuation pressure (%(default)g)")
    arguments.config(paths)
    reported = doing.add_parser("report", help="renew the tables of a document, and the figure beside it")
    reported.add_argument("document", type=Path, help="the document, for example docs/reliability.md")
    for part in (recorded, paths, reported):
        part.add_argument("--data", type=Path, default=Path("docs/data"), help="folder of the tables (default: %(default)s)")


def _reliability(chosen: argparse.Namespace) -> None:
    from limo.config.builds import with_found_builds
    from limo.config.load import load_config

    if chosen.doing == "report":
        from limo.reports.reliability import draw_band, renewed
        from limo.store.files import write_whole

        text = renewed(chosen.document.read_text(encoding="utf-8"), chosen.data)
        write_whole(chosen.document, lambda path: path.write_text(text, encoding="utf-8"))
        draw_band(chosen.data, chosen.document.with_name("reliability_paths.png"))
        return
    loaded, _ = with_found_builds(load_config(chosen.config), chosen.config)
    if chosen.doing == "record":
        from limo.reliability.stress_test import record_stress_test

        print(record_stress_test(loaded, chosen.results, chosen.data / "stress_test.csv"))
        return
    from limo.reliability.repeatability import append_rows, measure

    for rows in measure(loaded, chosen.engine, tuple(chosen.kinds), chosen.to):
        append_rows(rows, chosen.data / "repeatability.csv")
        print(
            f"{rows[0]['kind']} {rows[0]['run']}: {rows[0]['status']}, stroke {float(rows[-1]['stroke_volume']):.2f} ml",
            flush=True,
        )


def add_accuracy(commands: arguments.Commands) -> None:
    """``limo accuracy``."""
    made = commands.add(
        _accuracy,
        "accuracy",
        "print the report of measured errors from the tables that `snakemake accuracy` keeps",
        "> docs/accuracy.md",
        "--add",
    )
    made.add_argument(
        "--add",
        action="store_true",
        help="print nothing, but add the runs of error studies that are solved to the kept rows, and draw their figures",
    )
    made.add_argument(
        "--table", type=Path, default=Path("docs/gallery/data/airbag.csv"), help="rows of the airbags (default: %(default)s)"
    )
    made.add_argument(
        "--errors", type=Path, default=Path("docs/gallery/data/accuracy.nc"), help="rows of the device (default: %(default)s)"
    )
    arguments.config(made)
    arguments.results(made)


def _accuracy(chosen: argparse.Namespace) -> None:
    from limo.reports.accuracy import add_to, report

    if chosen.add:
        print(*add_to(chosen.errors, chosen.results, chosen.config), sep="\n")
    else:
        print(report(chosen.table, chosen.errors, chosen.config), end="")


def add_docs(commands: arguments.Commands) -> None:
    """``limo docs``."""
    made = commands.add(
        _docs,
        "docs",
        "write what is generated in the documents and needs no solver: README, references, reports",
        "",
        "README.md docs/configuration.md",
        "--check",
    )
    made.add_argument("documents", nargs="*", type=Path, metavar="FILE", help="which documents (default: all)")
    made.add_argument("--check", action="store_true", help="write nothing; exit code 1 if a document is not up to date")


def _docs(chosen: argparse.Namespace) -> None:
    from limo.reports.documents import stale, write_documents

    names = [document.as_posix() for document in chosen.documents]
    if not chosen.check:
        print("\n".join(write_documents(Path(), names)) or "all documents are up to date")
    elif found := stale(Path(), names):
        raise LimoError(f"not up to date: {', '.join(found)}; limo docs writes them")


def add_infer(commands: arguments.Commands) -> None:
    """``limo infer``."""
    made = commands.add(
        _infer,
        "infer",
        "infer unknown seams and numbers of pouches from half of the paper's statements; the other half tests them",
        "",
        "--data results/studies --file config/inferences/seams.yaml",
    )
    made.add_argument("--data", type=Path, default=Path("results/studies"), help="folder of datasets (default: %(default)s)")
    made.add_argument(
        "--file", type=Path, default=Path("config/inferences/seams.yaml"), help="what is asked (default: %(default)s)"
    )
    made.add_argument("--table", type=Path, default=Path("results/inference.csv"), help="default: %(default)s")


def _infer(chosen: argparse.Namespace) -> None:
    from limo.reports.inference import write_inference

    print(write_inference(chosen.file, chosen.data, chosen.table))
    print(chosen.table)
