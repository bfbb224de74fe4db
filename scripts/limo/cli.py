"""``limo``: the few commands a person types beside snakemake."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from limo.errors import LimoError

DONE, MISTAKE, USAGE, FAILED, INTERRUPTED = 0, 1, 2, 3, 130
EXIT_CODES = """exit codes:
  0    done
  1    a mistake in the configuration, or a file that cannot be used: one message says which
  2    no such command or option
  3    status and sweep: a case failed or was broken off, or snakemake failed
  130  ended by Ctrl-C"""

_ABBREVIATED = """A case is named by a beginning of its name, or by parts of it that no other case has together, such as
np6 pv13.8 ar2 eh1 preview fast, or the first letters of its hash."""


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit code (see ``EXIT_CODES``)."""
    arguments = sys.argv[1:] if arguments is None else arguments
    own, options = _split(arguments)
    chosen = make_parser().parse_args(own)
    chosen.options = options
    try:
        return chosen.run(chosen) or DONE
    except LimoError as error:
        print(error, file=sys.stderr)
        return MISTAKE
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # such as `limo status | head`
        sys.stderr.close()
        return DONE


def _split(arguments: list[str]) -> tuple[list[str], list[str]]:
    """What is before and behind ``--``: limo's own arguments, and others, such as options of snakemake."""
    at = arguments.index("--") if "--" in arguments else len(arguments)
    return arguments[:at], arguments[at + 1 :]


def make_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = argparse.ArgumentParser(
        prog="limo",
        description=__doc__.replace("``", ""),
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    @contextmanager
    def command(run: Callable, name: str, says: str, *examples: str, epilog: str = "") -> Iterator[argparse.ArgumentParser]:
        lines = ["examples:", *(f"  limo {name} {e}".rstrip() for e in examples or [""])]
        epilog = "\n".join([*([epilog, ""] if epilog else []), *lines])
        made = commands.add_parser(
            name, help=says, description=says, epilog=epilog, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        made.set_defaults(run=run)
        yield made

    says = "fit Young's modulus to tensile tests: a table of specimens, the fit with its window and errors, a picture"
    with command(
        _tensile, "tensile", says,
        "config/measured/uniaxial_synthetic.csv --length 200 --width 50 --thickness 0.19",
        "a.csv b.csv --length 100 --width 15 --thickness 0.06 --set units.force=kN --json", "--into limo",
    ) as made:  # fmt: skip
        made.add_argument("files", nargs="*", type=Path, metavar="FILE", help="(default: tensile_test of the configuration)")
        for size in ("length", "width", "thickness"):
            made.add_argument(f"--{size}", type=float, metavar="MM", help="of the coupon")
        made.add_argument("--method", choices=("found", "window", "paper"), help="of the fit (default: found)")
        made.add_argument("--window", nargs=2, type=float, metavar="STRAIN", help="lowest and highest strain of the fit")
        made.add_argument(
            "--set",
            action="append",
            default=[],
            metavar="KEY=VALUE",
            help="any other key of docs/bench.md, such as units.force=kN",
        )
        made.add_argument("--json", action="store_true", help="print JSON for machines; youngs_modulus is in MPa")
        made.add_argument("--picture", type=Path, metavar="FILE", help="default: results/tensile/FILE.png")
        made.add_argument("--into", metavar="DEVICE", help="write the modulus into a file in config/devices, with its origin")
        _config(made)
        _results(made)
    says = "compare a study with measured curves: what was understood of them, relative errors by N_p, efficiencies"
    with command(
        _measured, "measured", says, "mine", "pressure_volume --data mine.csv --set units.actuation_pressure=mmHg"
    ) as made:
        made.add_argument("study", metavar="STUDY", help="a study by name")
        made.add_argument("--data", type=Path, metavar="FILE", help="other curves than those the study names")
        made.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a key of docs/bench.md, with --data")
        _config(made)
        _results(made)
    says = "validate the configuration, say what is solved and how long the rest will take, run nothing"
    with command(_check, "check", says, "", "pressure_volume afterload --cores 8", "afterload --draw svg --mesh") as made:
        _studies(made)
        made.add_argument(
            "--draw", nargs="?", const="png", choices=("png", "svg"), help="draw the flat patterns into results/patterns (png)"
        )
        made.add_argument("--mesh", action="store_true", help="with --draw: draw the mesh, too, which takes some seconds each")
        _config(made)
        _results(made)
        _cores(made)
    says = "write a commented study to start from"
    with command(_new_study, "new-study", says, "thick_fabric", "small --device mini_limo") as made:
        made.add_argument("name", metavar="NAME", help="name of the study and of its file in config/studies")
        made.add_argument("--device", default="limo", metavar="DEVICE", help="a file in config/devices (default: %(default)s)")
        _config(made)
    says = "write the cutting pattern of a device to scale, as SVG and DXF with seams on their own layer"
    with command(_pattern, "pattern", says, "limo 6", "mini_limo 6 --allowance 5 --to cutting") as made:
        made.add_argument("device", metavar="DEVICE", help="a file in config/devices")
        made.add_argument("n_pouches", metavar="N_P", type=int, help="number of pouches on both faces together")
        made.add_argument("--allowance", type=float, default=0.0, metavar="MM", help="of the cut lines beyond the seals (0)")
        made.add_argument("--width-scale", type=float, metavar="FACTOR", help="instead of the device's own")
        made.add_argument("--to", type=Path, default=Path("results/patterns"), metavar="FOLDER", help="default: %(default)s")
        _config(made)
    says = "show where the cases of a running or finished sweep are"
    with command(_status, "status", says, "", "--watch", "afterload --json", "--watch 10 > sweep.txt") as made:
        _studies(made, "those that the configuration runs; cases of others while they are solved")
        made.add_argument(
            "--watch", nargs="?", type=float, const=2.0, metavar="SECONDS", help="show it again every so many seconds (2)"
        )
        made.add_argument("--json", action="store_true", help="print JSON for machines")
        _config(made)
        _results(made)
        _cores(made)
    says = "run snakemake on studies and show their cases meanwhile"
    with command(_sweep, "sweep", says, "pressure_volume", "afterload compliance --cores 8 -- --rerun-incomplete") as made:
        _studies(made, "those that the configuration runs")
        _config(made)
        _cores(made)
        made.set_defaults(results=Path("results"))
    says = "show one case: what it is, its volumes, buckling events, costs and files"
    with command(_show, "show", says, "np6 pv13.8", "limo_np4_pv3.8 --at 10 20 --picture", epilog=_ABBREVIATED) as made:
        made.add_argument("case", nargs="+", metavar="CASE", help="words of its name")
        made.add_argument(
            "--at", nargs="+", type=float, default=[], metavar="KPA", help="P_a of the volumes (those of its frames)"
        )
        made.add_argument("--picture", nargs="?", type=Path, const=Path(), metavar="FILE", help="draw its curves (case.png)")
        _results(made)
    says = "compare two cases: parameters that differ, curves, costs"
    with command(
        _compare, "compare", says, "np4,pv3.8 np6,pv3.8", "'np6 95201436ca' 'np6 6d9cb32527'", epilog=_ABBREVIATED
    ) as made:
        made.add_argument("first", metavar="CASE", help="words of its name, with commas between them")
        made.add_argument("second", metavar="CASE", help="the other one, likewise")
        _results(made)
    with command(_table, "table", "print the results of a study", "results/studies/pressure_volume/study.nc") as made:
        made.add_argument("dataset", type=Path, help="study.nc of a study")
    says = "gather what is there of all studies into results/index.html, a page to look at in a browser"
    with command(_page, "page", says, "", "--results copied/results") as made:
        _config(made)
        _results(made)
    with command(_benchmark, "benchmark", "print where the time of the solved cases went") as made:
        _results(made)
    says = "keep measured costs in a table, and write the report of it"
    with command(
        _performance, "performance", says, "record levers --config config/levers/config.yaml", "report > docs/performance.md"
    ) as made:
        doing = made.add_subparsers(dest="doing", required=True)
        recorded = doing.add_parser("record", help="put the costs of a configuration's solved cases into the table")
        recorded.add_argument("batch", help="name of the runs that were measured together, for example levers")
        _studies(recorded, "those the configuration runs")
        _config(recorded)
        _results(recorded)
        timed = doing.add_parser("overhead", help="time a sweep with nothing to do, and the planning of a thousand cases")
        _config(timed)
        printed = doing.add_parser("report", help="print the report")
        for part in (recorded, printed):
            part.add_argument(
                "--table", type=Path, default=Path("docs/data/performance.csv"), help="the table (default: %(default)s)"
            )
        for part in (timed, printed):
            part.add_argument(
                "--overhead", type=Path, default=Path("docs/data/overhead.csv"), help="its table (default: %(default)s)"
            )
    says = "test the paper's statements on the datasets of the studies; write the table and a page of it"
    with command(_paper_check, "paper-check", says, "", "--data docs/gallery/data") as made:
        made.add_argument("--data", type=Path, default=Path("results/studies"), help="folder of datasets (default: %(default)s)")
        made.add_argument("--beside", type=Path, metavar="DATA", help="other datasets, whose verdicts get a column")
        made.add_argument("--table", type=Path, default=Path("results/paper_check.csv"), help="default: %(default)s")
        made.add_argument("--page", type=Path, default=Path("results/paper_check.md"), help="default: %(default)s")
    says = "keep the datasets of studies in the gallery, and draw its figures and its page from them"
    with command(
        _gallery, "gallery", says, "", "afterload compliance", "--redraw", "--set standard --config config/standard.yaml"
    ) as made:
        _studies(made, "all that are gathered")
        made.add_argument("--redraw", action="store_true", help="draw what the gallery holds and copy nothing into it")
        made.add_argument("--to", type=Path, default=Path("docs/gallery"), metavar="FOLDER", help="default: %(default)s")
        made.add_argument(
            "--set", dest="part", default="", metavar="NAME",
            help="a set beside the first one, in a folder of this name: curves and pictures, without surfaces; it grows by the "
            "cases that are solved",
        )  # fmt: skip
        made.add_argument(
            "--lacking", action="store_true", help="print the files that snakemake is to make for the set, and do nothing else"
        )
        _config(made)
        _results(made)
    says = "measure how reliable solves are, and renew the tables of docs/reliability.md"
    with command(
        _reliability, "reliability", says, "record", "paths newton --kinds same branch", "report docs/reliability.md"
    ) as made:
        doing = made.add_subparsers(dest="doing", required=True)
        recorded = doing.add_parser("record", help="keep what the stress test found so far: the cases that are solved")
        _config(recorded)
        _results(recorded)
        paths = doing.add_parser("paths", help="solve one case again, perturbed, by other builds and on other meshes")
        paths.add_argument("engine", choices=("calculix", "newton"), help="what solves it")
        paths.add_argument(
            "--kinds", nargs="+", choices=("same", "build", "branch", "mesh"), default=["same", "build", "branch", "mesh"],
            help="which runs (default: all)",
        )  # fmt: skip
        paths.add_argument("--to", type=float, default=60.0, metavar="KPA", help="highest actuation pressure (%(default)g)")
        _config(paths)
        reported = doing.add_parser("report", help="renew the tables of a document, and the figure beside it")
        reported.add_argument("document", type=Path, help="the document, for example docs/reliability.md")
        for part in (recorded, paths, reported):
            part.add_argument("--data", type=Path, default=Path("docs/data"), help="folder of the tables (default: %(default)s)")
    says = "print the report of measured errors from the tables that `snakemake accuracy` keeps"
    with command(_accuracy, "accuracy", says, "> docs/accuracy.md", "--add") as made:
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
        _config(made)
        _results(made)
    says = "delete what no study uses and what killed solvers left; without --yes only say what and how much that is"
    with command(
        _clean, "clean", says, "", "leftovers --yes", "cases --config config/config.yaml config/levers/config.yaml"
    ) as made:
        made.add_argument(
            "kinds",
            nargs="*",
            metavar="KIND",
            help="leftovers (of solvers), cases (and meshes that no study uses); default: both",
        )
        made.add_argument("--yes", action="store_true", help="delete it")
        made.add_argument(
            "--config",
            nargs="+",
            default=["config/config.yaml"],
            metavar="FILE",
            help="configurations whose studies' cases stay (default: config/config.yaml)",
        )
        _results(made)
    says = "print what a shell has to read to complete limo's words on the Tab key"
    with command(_completion, "completion", says, "bash >> ~/.bashrc", "zsh > ~/.zfunc/_limo") as made:
        made.add_argument("shell", choices=("bash", "zsh", "words"), help="words: complete what follows -- (for the scripts)")
    return parser


def _studies(parser: argparse.ArgumentParser, default: str = "all") -> None:
    parser.add_argument("studies", nargs="*", metavar="STUDY", help=f"studies by name (default: {default})")


def _config(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--config", default="config/config.yaml", help="configuration file (default: %(default)s)")


def _results(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of results (default: %(default)s)")


def _cores(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--cores", type=int, default=2, help="cores for the sweep (default: %(default)s)")


# --------------------------------------------------------------------------------------------------------------------
# one function a command; each imports what it needs, so that the others start at once


def _check(chosen: argparse.Namespace) -> None:
    from limo.tables import plan_table

    print(plan_table(chosen.config, chosen.studies, chosen.results, chosen.cores))
    if chosen.draw:
        from limo.drawing import draw_studies

        for file in draw_studies(chosen.config, chosen.studies, chosen.results, chosen.draw, chosen.mesh):
            print(f"  drawn: {file}")


def _tensile(chosen: argparse.Namespace) -> None:
    from limo.bench.command import put_into, run_tensile, tensile_text, test_of

    if chosen.files:
        keys = {key: getattr(chosen, key) for key in ("length", "width", "thickness", "method", "window")}
        test = test_of(chosen.files, keys, chosen.set)
    else:
        from limo.config import load_config

        test = load_config(chosen.config).config.tensile_test
    fit, picture = run_tensile(test, chosen.results / "tensile", picture=chosen.picture, stated=bool(chosen.files))
    device = put_into(fit, chosen.config, chosen.into) if chosen.into else None
    print(tensile_text(fit, picture, device, as_json=chosen.json))


def _measured(chosen: argparse.Namespace) -> None:
    from limo.bench.command import curves_of
    from limo.bench.compare import measured_table
    from limo.config import load_config

    loaded = load_config(chosen.config)
    loaded.require([chosen.study], chosen.config, "limo measured pressure_volume")
    print(measured_table(loaded, chosen.study, chosen.results, curves_of(chosen.data, chosen.set)))


def _new_study(chosen: argparse.Namespace) -> None:
    from limo.scaffold import new_study

    file = new_study(chosen.config, chosen.name, chosen.device)
    print(f"{file}: edit it, then: limo check {chosen.name} --draw; limo sweep {chosen.name}")


def _pattern(chosen: argparse.Namespace) -> None:
    from limo.drawing import write_pattern

    arguments = (chosen.config, chosen.device, chosen.n_pouches, chosen.to, chosen.width_scale, chosen.allowance)
    for file in write_pattern(*arguments):
        print(file)


def _status(chosen: argparse.Namespace) -> int:
    import json

    from limo import monitor
    from limo.status import open_sweep, to_plain

    sweep = open_sweep(chosen.config, chosen.studies, chosen.results, chosen.cores)
    if chosen.json:
        statuses = sweep.look()
        print(json.dumps(to_plain(sweep, statuses), indent=2))
    elif chosen.watch is not None:
        statuses = monitor.watch(sweep, monitor.console(), max(chosen.watch, 0.1))
    else:
        statuses = monitor.show(sweep, monitor.console())
    return FAILED if monitor.failed(statuses) else DONE


def _sweep(chosen: argparse.Namespace) -> int:
    from limo import monitor
    from limo.status import open_sweep

    sweep = open_sweep(chosen.config, chosen.studies, chosen.results, chosen.cores)
    options = (chosen.config, chosen.studies, chosen.cores, chosen.options)
    well = monitor.run_sweep(sweep, *options, monitor.console())
    if not {"-n", "--dry-run", "--dryrun"} & {*chosen.options}:
        _page(chosen)
    return DONE if well else FAILED


def _show(chosen: argparse.Namespace) -> None:
    from limo.inspection import draw_case, show_case

    if chosen.picture is not None:
        draw_case(chosen.results, chosen.case, chosen.picture if chosen.picture.name else None)
    print(show_case(chosen.results, chosen.case, chosen.at))
    if chosen.picture is not None and chosen.picture.name:
        print(f"  {chosen.picture}")


def _compare(chosen: argparse.Namespace) -> None:
    from limo.inspection import compare_cases

    print(compare_cases(chosen.results, chosen.first, chosen.second))


def _table(chosen: argparse.Namespace) -> None:
    from limo.tables import study_table

    print(study_table(chosen.dataset))


def _page(chosen: argparse.Namespace) -> None:
    from limo.config import load_config
    from limo.page.write import write_page

    print(write_page(chosen.results, load_config(chosen.config).studies))


def _benchmark(chosen: argparse.Namespace) -> None:
    from limo.performance import benchmark_table

    print(benchmark_table(chosen.results))


def _performance(chosen: argparse.Namespace) -> None:
    from limo.overhead import read_overhead, record_overhead
    from limo.performance import read_measurements, record_batch, report

    if chosen.doing == "record":
        print(record_batch(chosen.config, chosen.batch, chosen.studies, chosen.results, chosen.table))
    elif chosen.doing == "overhead":
        print(record_overhead(Path(chosen.config), chosen.overhead))
    else:
        print(report(read_measurements(chosen.table), read_overhead(chosen.overhead)), end="")


def _paper_check(chosen: argparse.Namespace) -> None:
    from limo.paper_check import write_check

    print(f"{write_check(chosen.data, chosen.table, chosen.page, chosen.beside)}: {chosen.table}, {chosen.page}")


def _gallery(chosen: argparse.Namespace) -> None:
    from limo.gallery import lacking_of_set, make_gallery

    where = chosen.config, chosen.studies, chosen.results, chosen.to, chosen.part
    for file in lacking_of_set(*where) if chosen.lacking else make_gallery(*where, redraw=chosen.redraw):
        print(file)


def _reliability(chosen: argparse.Namespace) -> None:
    from limo.config import load_config
    from limo.engines.find import find_engines

    if chosen.doing == "report":
        from limo.files import write_whole
        from limo.reliability_report import draw_band, renewed

        text = renewed(chosen.document.read_text(encoding="utf-8"), chosen.data)
        write_whole(chosen.document, lambda path: path.write_text(text, encoding="utf-8"))
        draw_band(chosen.data, chosen.document.with_name("reliability_paths.png"))
        return
    loaded = load_config(chosen.config)
    find_engines(loaded, chosen.config)
    if chosen.doing == "record":
        from limo.reliability import record_stress_test

        print(record_stress_test(loaded, chosen.results, chosen.data / "stress_test.csv"))
        return
    from limo.repeatability import append_rows, measure

    for rows in measure(loaded, chosen.engine, tuple(chosen.kinds), chosen.to):
        append_rows(rows, chosen.data / "repeatability.csv")
        print(
            f"{rows[0]['kind']} {rows[0]['run']}: {rows[0]['status']}, stroke {float(rows[-1]['stroke_volume']):.2f} ml",
            flush=True,
        )


def _accuracy(chosen: argparse.Namespace) -> None:
    from limo.accuracy import add_to, report

    if chosen.add:
        print(*add_to(chosen.errors, chosen.results, chosen.config), sep="\n")
    else:
        print(report(chosen.table, chosen.errors, chosen.config), end="")


def _clean(chosen: argparse.Namespace) -> None:
    from limo.cleaning import KINDS, delete, describe_rubbish, find_rubbish

    for kind in chosen.kinds:
        if kind not in KINDS:
            raise LimoError(f"{kind}: expected one of: {', '.join(KINDS)}; for example: limo clean leftovers")
    rubbish = find_rubbish(chosen.config, chosen.results, chosen.kinds or KINDS)
    print(describe_rubbish(rubbish, chosen.results))
    if rubbish and chosen.yes:
        delete(rubbish)
        print("deleted")
    elif rubbish:
        print("nothing was deleted: the same with --yes deletes it")


def _completion(chosen: argparse.Namespace) -> None:
    from limo.completion import candidates, script

    if chosen.shell == "words":
        print("\n".join(candidates(make_parser(), chosen.options)))
    else:
        print(script(chosen.shell), end="")


if __name__ == "__main__":
    sys.exit(main())
