#!/usr/bin/env bash
# Adds Snakemake's plugin for Slurm to .venv (docs/cluster.md), seen only by a Snakemake that is to submit.
#
# Snakemake imports every plugin at each start, and this one imports pandas: a quarter of a second. So it lies in a folder of its
# own, which Python looks into where a profile or an executor is named, and not in jobs of a sweep, which have LIMO_PLAN.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly FOLDER=$PWD/.local/cluster PYTHON=.venv/bin/python
rm -rf "$FOLDER"
"$PYTHON" -m pip install --quiet --disable-pip-version-check --no-input --no-deps --require-hashes \
    --target "$FOLDER/plugins" --requirement requirements-cluster.lock
# what jobs need of it
mkdir "$FOLDER/steps"
mv "$FOLDER"/plugins/snakemake_executor_plugin_slurm_jobstep* "$FOLDER/steps"
"$PYTHON" - "$FOLDER" <<'CODE'
import sys
import sysconfig
from pathlib import Path

folder = sys.argv[1]
asking = '{"--workflow-profile", "--profile", "--executor", "-e"} & {word.partition("=")[0] for word in sys.orig_argv}'
asking = f'bool({asking} or "SNAKEMAKE_PROFILE" in os.environ) and "LIMO_PLAN" not in os.environ'
line = f'import os, sys; sys.path += [{folder + "/plugins"!r}] * ({asking})'
Path(sysconfig.get_path("purelib"), "limo_cluster.pth").write_text(f"{folder}/steps\n{line}\n")
CODE
