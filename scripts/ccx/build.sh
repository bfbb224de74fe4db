#!/usr/bin/env bash
# Builds .local/ccx-tuned/bin/ccx: CalculiX from its source package, with the patches beside this script and PARDISO of the
# MKL that is in .venv, tuned for this processor. docs/solver.md says what it brings.
#
# The executable links GPL code with MKL: it is for this machine only, never to be committed or passed on. A build that is
# up to date is kept; a new one replaces it only after it has repeated the stored answers of the stock solver.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

readonly SPEAKER=ccx-tuned VENV=$PWD/.venv LOCAL=$PWD/.local HERE=$PWD/scripts/ccx
readonly LOG=$LOCAL/ccx-tuned.log APT_STATE=$LOCAL/apt-ccx SOURCE=$LOCAL/ccx-source TARGET=$LOCAL/ccx-tuned
# shellcheck source-path=SCRIPTDIR/../..
. scripts/system_packages.sh

readonly VERSION=2.20 PACKAGE=calculix-ccx=2.20-1
readonly TARBALL=$SOURCE/calculix-ccx_$VERSION.orig.tar.bz2
readonly TARBALL_SHA256=b9a6075e181a777bbcfadd3ad21a70749dfdbb439373df3b4895cd2f438343ab

# No SPOOLES: PARDISO then is the default solver. No ARPACK: eigenvalues are not needed here.
readonly CFLAGS='-O2 -march=native -w -fopenmp -fcommon -DARCH=Linux -DMATRIXSTORAGE -DUSE_MT=1 -DPARDISO'
readonly FFLAGS='-O1 -w -fopenmp -fallow-argument-mismatch' FFLAGS_HOT='-O3 -march=native -w -fopenmp -fallow-argument-mismatch'
readonly MKL=(-l:libmkl_intel_lp64.so.3 -l:libmkl_gnu_thread.so.3 -l:libmkl_core.so.3)
# where a profile of the device finds the time, PARDISO aside; all of the source at -O3 takes longer to compile and gains nothing
readonly HOT=(add_sm_st.o e_c3d.o mafillsm.o materialdata_me.o op.o resultsmech.o shape20h.o wcoef.o)

mkl_version() { "$VENV/bin/python" -c 'from importlib.metadata import version; print(version("mkl"))' 2>/dev/null; }

# What a build depends on. The processor (its name and a hash of its features) counts: -march=native may not run on another.
digest() {
    cat scripts/ccx/build.sh scripts/ccx/patches/*.patch <(mkl_version) <(processor) | sha256sum | cut -c 1-16
}

processor() {
    printf '%s, features %s\n' "$(awk -F ': ' '/^model name/ {print $2; exit}' /proc/cpuinfo)" \
        "$(awk -F ': ' '/^flags/ {printf "%s", $2; exit}' /proc/cpuinfo | sha256sum | cut -c 1-8)"
}

# where it was unpacked; by its name alone, because make splits a path at blanks
PATH=$PATH:$LOCAL/gfortran/usr/bin
find_fortran() { command -v gfortran; }

have_compilers() { command -v gcc >/dev/null && command -v make >/dev/null && find_fortran >/dev/null; }

get_compilers() {
    have_compilers && return
    say "installing the compilers"
    system_install gcc gfortran make libc6-dev || unpack gfortran gfortran || true
    hash -r
    have_compilers || fail "gcc, gfortran and make are needed; install these packages, then call make ccx-tuned again"
}

source_is_pinned() { [ -f "$TARBALL" ] && echo "$TARBALL_SHA256  $TARBALL" | sha256sum --check --status; }

get_source() {
    source_is_pinned && return
    say "fetching the source package"
    fetch_source "$SOURCE" "$PACKAGE" || fail "the source package $PACKAGE cannot be had here; see .local/ccx-tuned.log"
    source_is_pinned || fail "the source package $PACKAGE is not the one that is pinned in scripts/ccx/build.sh"
}

# Unpacks and patches the sources into a folder; fails if a patch does not fit exactly.
prepare() {
    mkdir -p "$1"
    quietly "$VENV/bin/python" -m tarfile -e "$TARBALL" "$1" || return 1
    # without the ceiling git would take the folder for a part of this repository and patch nothing
    (cd "$1/CalculiX" && GIT_CEILING_DIRECTORIES=$1 quietly git apply "$HERE"/patches/*.patch)
}

compile() {
    local fortran libraries jobs
    local -r src=$1/CalculiX/ccx_$VERSION/src target=$2
    fortran=$(find_fortran)
    libraries=$(dirname "$("$fortran" -print-file-name=libgfortran.a)")
    jobs=-j$(nproc)
    quietly make -C "$src" "$jobs" FC=gfortran FFLAGS="$FFLAGS_HOT" "${HOT[@]}" &&
        quietly make -C "$src" "$jobs" FC=gfortran CC=gcc FFLAGS="$FFLAGS" CFLAGS="$CFLAGS" ccx_$VERSION.o ccx_$VERSION.a ||
        return 1
    mkdir -p "$target/bin"
    quietly gcc -fopenmp -o "$target/bin/ccx" "$src/ccx_$VERSION.o" "$src/ccx_$VERSION.a" \
        -L"$VENV/lib" -Xlinker -rpath -Xlinker "$VENV/lib" "${MKL[@]}" -L"$libraries" -lgfortran -lquadmath -lpthread -lm
}

# What `limo` stores with every result of this build.
describe() {
    "$VENV/bin/python" - "$1/build.json" digest "$(digest)" source "$PACKAGE" mkl "$(mkl_version)" processor "$(processor)" \
        compiler "$(gcc -dumpfullversion), gfortran $("$(find_fortran)" -dumpfullversion)" flags "$CFLAGS; $FFLAGS_HOT" \
        patches "$(cat scripts/ccx/patches/*.patch | sha256sum | cut -c 1-16)" <<'end'
import json, sys
from pathlib import Path

path, *words = sys.argv[1:]
Path(path).write_text(json.dumps(dict(zip(words[::2], words[1::2])), indent=2) + "\n")
end
}

mkdir -p "$LOCAL"
[ "$(cat "$TARGET/digest" 2>/dev/null)" != "$(digest)" ] || exit 0

: >"$LOG"
work=$(mktemp -d "$LOCAL/ccx-tuned.XXXXXX")
trap 'rm -rf "$APT_STATE" "$work"' EXIT
[ -n "$(mkl_version)" ] || fail "MKL is not in .venv; call make setup first"
get_source
get_compilers
say "compiling CalculiX $VERSION (some minutes)"
prepare "$work/source" || fail "the patches do not fit the source; see .local/ccx-tuned.log"
compile "$work/source" "$work/build" || fail "CalculiX could not be compiled; see .local/ccx-tuned.log"
quietly "$VENV/bin/python" scripts/ccx/verify/verify.py "$work/build/bin/ccx" ||
    fail "the build does not repeat the stored answers and is not used; see .local/ccx-tuned.log"
describe "$work/build"
digest >"$work/build/digest"
rm -rf "$TARGET"
mv "$work/build" "$TARGET"
say "done: .local/ccx-tuned/bin/ccx gives the stock solver's answers"
