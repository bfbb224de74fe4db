"""``limo``: the few commands a person types beside snakemake."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from limo.errors import LimoError


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit code (0 done, 1 a user's mistake or unusable file)."""
    parser = argparse.ArgumentParser(prog="limo", description=__doc__.replace("``", ""))
    commands = parser.add_subparsers(dest="command", required=True)
    check = commands.add_parser("check", help="validate the configuration and list its cases without running anything")
    check.add_argument("--config", default="config/config.yaml", help="configuration file (default: %(default)s)")
    table = commands.add_parser(
        "table", help="print the results of a study", epilog="example: limo table results/studies/pressure_volume/study.nc"
    )
    table.add_argument("dataset", type=Path, help="study.nc of a study")
    benchmark = commands.add_parser("benchmark", help="print where the time of the solved cases went")
    benchmark.add_argument("--results", type=Path, default=Path("results"), help="folder of results (default: %(default)s)")
    chosen = parser.parse_args(arguments)
    try:
        if chosen.command == "check":
            print(_check(chosen.config))
        elif chosen.command == "table":
            from limo.tables import study_table

            print(study_table(chosen.dataset))
        else:
            from limo.tables import benchmark_table

            print(benchmark_table(chosen.results))
    except LimoError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _check(config_file: str) -> str:
    from limo.case import all_cases, study_cases
    from limo.config import load_config
    from limo.engines.calculix import find_ccx

    loaded = load_config(config_file)
    command = find_ccx(loaded.config.solver, config_file)
    lines = [f"{config_file}: valid; solver {command}"]
    for name in loaded.studies:
        cases = study_cases(loaded, name)
        meshes = {case.mesh_id for case in cases.values()}
        lines.append(
            f"  {name}: {len(cases)} cases on {len(meshes)} meshes" + ("  (default)" if name in loaded.config.studies else "")
        )
    lines.append(f"  {len(all_cases(loaded))} distinct cases in all studies together")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
