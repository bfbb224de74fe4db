# shellcheck shell=bash
# System packages for scripts/setup.sh and scripts/ccx/build.sh: installed as root, else unpacked below .local/.
# To be sourced with SPEAKER (what messages start with), LOCAL, LOG and APT_STATE (a folder that may be removed) set.

# Unpacked are libraries and what was asked for; never the C library, which must be the system's, nor display drivers,
# which meshing does not need.
readonly UNPACKED='^(lib|zlib1g|calculix-ccx|gfortran|python3-pip-whl)'
readonly NOT_UNPACKED='^(libc6|libc-bin|libllvm.*|libgl1-mesa-dri|libglx-mesa0)$'

say() { printf '%s: %s\n' "$SPEAKER" "$*"; }

fail() {
    printf '%s: %s\n' "$SPEAKER" "$*" >&2
    exit 1
}

# Runs a command with its output in the log.
quietly() {
    printf '\n$ %s\n' "$*" >>"$LOG"
    "$@" >>"$LOG" 2>&1 </dev/null
}

is_root() { [ "$(id -u)" -eq 0 ]; }

system_install() {
    is_root && command -v apt-get >/dev/null || return 1
    if [ -z "${UPDATED:-}" ]; then
        quietly apt-get update || true
        UPDATED=yes
    fi
    quietly env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 install -y --no-install-recommends "$@"
}

# apt-get that neither needs root nor touches the system's state; APT_OPTIONS may hold more options.
APT_OPTIONS=()
private_apt() {
    apt-get -o Dir::State="$APT_STATE" -o Dir::State::status=/var/lib/dpkg/status -o Dir::Cache="$APT_STATE" \
        -o Debug::NoLocking=true -o APT::Sandbox::User="$(id -un 2>/dev/null || echo root)" "${APT_OPTIONS[@]}" "$@"
}

# unpack FOLDER PACKAGE...: unpacks packages, and the libraries that they need and the system lacks, below .local/FOLDER.
unpack() {
    local folder=$LOCAL/$1 names deb
    shift
    command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null || return 1
    if [ ! -d "$APT_STATE/lists" ]; then
        mkdir -p "$APT_STATE/lists/partial" "$APT_STATE/archives/partial"
        quietly private_apt update || true
    fi
    names=$(private_apt --simulate --no-install-recommends install "$@" 2>>"$LOG" |
        awk '/^Inst / {print $2}' | grep -E "$UNPACKED" | grep -vE "$NOT_UNPACKED") || return 1
    rm -rf "$folder" "$APT_STATE/debs"
    mkdir -p "$folder" "$APT_STATE/debs"
    # shellcheck disable=SC2086
    (cd "$APT_STATE/debs" && quietly private_apt download $names) || return 1
    for deb in "$APT_STATE"/debs/*.deb; do
        quietly dpkg-deb -x "$deb" "$folder" || return 1
    done
}

# Lets private_apt use the servers that this system is set up with through a copy of their list, changed by sed's SCRIPT.
use_copied_sources() {
    local sources=$APT_STATE/sources
    mkdir -p "$sources" "$APT_STATE/lists/partial" "$APT_STATE/archives/partial"
    cp /etc/apt/sources.list.d/*.sources /etc/apt/sources.list.d/*.list /etc/apt/sources.list "$sources" 2>/dev/null || true
    sed -i -E "$1" "$sources"/* || return 1
    APT_OPTIONS=(-o Dir::Etc::SourceList=/dev/null -o Dir::Etc::SourceParts="$sources")
    quietly private_apt update || true
}

# A sed script that leads to Debian 12; fails where this is not another Debian.
to_debian_12() {
    local id codename
    # in a shell of its own: the file sets many variables
    # shellcheck disable=SC2016
    read -r id codename <<<"$(env -i bash -c '. /etc/os-release; echo "$ID" "${VERSION_CODENAME:-}"')"
    [ "$id" = debian ] && [ -n "$codename" ] && [ "$codename" != bookworm ] || return 1
    printf 's/\\b(%s|stable|testing)\\b/bookworm/g' "$codename"
}

# The same as unpack with Debian 12's packages, and as if nothing was installed.
unpack_from_debian_12() {
    local script
    script=$(to_debian_12) || return 1
    rm -rf "$APT_STATE"
    use_copied_sources "$script" || return 1
    : >"$APT_STATE/status"
    APT_OPTIONS+=(-o Dir::State::status="$APT_STATE/status")
    unpack "$@" || return 1
    rm -rf "$APT_STATE"
    APT_OPTIONS=()
}

# fetch_source FOLDER PACKAGE=VERSION: the files of a source package, from this system's servers or from Debian 12.
fetch_source() {
    local to_sources='s/^(Types:).*/\1 deb-src/; s/^deb[[:space:]]/deb-src /' folder=$1 script
    command -v apt-get >/dev/null || return 1
    for script in "$to_sources" "$(to_debian_12 || true)"; do
        [ -n "$script" ] || continue
        [ "$script" = "$to_sources" ] || script="$to_sources; $script"
        rm -rf "$APT_STATE"
        use_copied_sources "$script" || return 1
        mkdir -p "$folder"
        if (cd "$folder" && quietly private_apt source --download-only "$2"); then
            APT_OPTIONS=()
            return
        fi
    done
    APT_OPTIONS=()
    return 1
}

# Folders of the shared libraries unpacked below a folder, relative to it.
library_folders() { (cd "$1" && find . -path '*/lib/*' -name '*.so.[0-9]*' -printf '%h\n' | sed 's,^\./,,' | sort -u); }
