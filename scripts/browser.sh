#!/usr/bin/env bash
# Brings Chromium, in which the page of results is tested (`make test`); where it cannot be had, that test is skipped.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly SPEAKER=test LOCAL=$PWD/.local
readonly LOG=$LOCAL/browser.log APT_STATE=$LOCAL/apt
# shellcheck source-path=SCRIPTDIR/..
. scripts/system_packages.sh

command -v chromium >/dev/null && exit
mkdir -p "$LOCAL"
: >"$LOG"
say "installing Chromium"
system_install chromium || say "the page is not tested in a browser: that takes the system's package chromium"
