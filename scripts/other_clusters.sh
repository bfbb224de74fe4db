#!/usr/bin/env bash
# Plans a sweep with each profile of a cluster other than Slurm and with its plugin, as docs/cluster.md says. The plugins are
# installed into a folder that is removed at the end; nothing is submitted.
#
#   scripts/other_clusters.sh [STUDY]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly STUDY=${1:-afterload} PYTHON=.venv/bin/python
readonly PLUGINS=(lsf==0.3.3 kubernetes==0.5.1 googlebatch==0.5.1) STORAGE=snakemake-storage-plugin-fs==1.1.2

FOLDER=$(mktemp -d)
trap 'rm -rf "$FOLDER"' EXIT
for plugin in "${PLUGINS[@]}"; do
    name=${plugin%%==*}
    # what is installed already stays as it is locked
    "$PYTHON" -m pip install --quiet --disable-pip-version-check --no-input --target "$FOLDER/$name" \
        --constraint <("$PYTHON" -m pip freeze --exclude-editable) "snakemake-executor-plugin-$plugin" "$STORAGE"
    echo "== $name"
    PYTHONPATH=$FOLDER/$name "$PYTHON" -m snakemake --workflow-profile "workflow/profiles/$name" --dry-run --quiet -- "$STUDY"
done
