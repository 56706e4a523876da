#!/usr/bin/env bash
# Installs the two Embree libraries that comparisons use, on Debian and its relatives:
#
#   - the distribution's own package: libembree4-4 where there is one, else libembree3-3;
#   - Embree 4.4, out of the wheel of the Python package embreex, into DIR (default
#     peers/embree under the repository), because distributions carry older versions.
#
# Usage: ci/setup-embree.sh [DIR]
#
# Does nothing twice. The last line printed is the setting that makes Niwaki use 4.4:
#
#   eval "$(ci/setup-embree.sh | tail -n 1)"
set -euo pipefail

readonly PACKAGE='embreex==4.4.0.post1'

say() { printf 'setup-embree: %s\n' "$*" >&2; }
die() {
    say "error: $*"
    exit 1
}

if [ "$#" -gt 1 ]; then
    die "expected at most one argument, the folder for Embree 4.4"
fi
repository="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
target="${1:-$repository/peers/embree}"
mkdir -p "$target" || die "cannot make the folder $target"
target="$(cd "$target" && pwd)"

as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        die "installing packages needs root: run this as root or install sudo"
    fi
}

updated=false
update_lists() {
    if ! $updated; then
        say "updating the package lists"
        as_root apt-get update -qq >&2 || say "warning: apt-get update failed; going on with old lists"
        updated=true
    fi
}

is_installed() { [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null)" = installed ]; }
# A package is available if apt names a version that it would install.
# (Not by a pipe into grep -q, whose early end would fail the pipe under pipefail.)
is_available() {
    local policy
    policy="$(LC_ALL=C apt-cache policy "$1" 2>/dev/null)" || return 1
    [[ "$policy" =~ Candidate:\ [0-9] ]]
}

install_package() {
    say "installing $1"
    # Through env, since sudo drops the caller's variables.
    as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y -qq --no-install-recommends "$1" >&2 \
        || die "apt-get could not install $1"
}

install_system_embree() {
    if ! command -v apt-get >/dev/null; then
        say "no apt-get here: leaving the system's Embree as it is"
        return
    fi
    local package
    for package in libembree4-4 libembree3-3; do
        if is_installed "$package"; then
            say "$package is installed"
            return
        fi
    done
    if ! is_available libembree4-4 && ! is_available libembree3-3; then
        update_lists
    fi
    for package in libembree4-4 libembree3-3; do
        if is_available "$package"; then
            update_lists
            install_package "$package"
            return
        fi
    done
    say "warning: this distribution has neither libembree4-4 nor libembree3-3"
}

need_python() {
    command -v python3 >/dev/null && python3 -m pip --version >/dev/null 2>&1 && return
    command -v apt-get >/dev/null || die "python3 with pip is needed and there is no apt-get to install it"
    update_lists
    install_package python3-pip
    python3 -m pip --version >/dev/null 2>&1 || die "python3 -m pip does not work even with python3-pip installed"
}

# True if the library and all that it needs can be loaded.
loads() { python3 -c 'import ctypes, sys; ctypes.CDLL(sys.argv[1])' "$1" 2>/dev/null; }

install_embree_4_4() {
    local link="$target/libembree4.so.4"
    # The name of the package and its version, so that a newer script replaces an older library.
    local stamp="$target/package"
    need_python
    if [ -e "$link" ] && [ "$(cat "$stamp" 2>/dev/null)" = "$PACKAGE" ] && loads "$link"; then
        say "$link is installed"
        return
    fi
    scratch="$(mktemp -d)"
    trap 'rm -rf "$scratch"' EXIT
    say "fetching $PACKAGE"
    # The library does not depend on Python's version: if there is no wheel for the one that runs
    # here, another's will do.
    python3 -m pip download --quiet --disable-pip-version-check --no-deps --only-binary=:all: \
        --dest "$scratch" "$PACKAGE" >&2 \
        || python3 -m pip download --quiet --disable-pip-version-check --no-deps --only-binary=:all: \
            --implementation cp --python-version 3.12 --dest "$scratch" "$PACKAGE" >&2 \
        || die "pip could not fetch $PACKAGE (no network, or no wheel for $(uname -m))"
    # The libraries find each other in one folder by names that were changed when the wheel was
    # made (libembree4-1234abcd.so.4 asks for libtbb-5678abcd.so.12), so they stay together.
    python3 - "$scratch" <<'PYTHON' || die "the wheel of $PACKAGE does not hold Embree as expected"
import pathlib, sys, zipfile
folder = pathlib.Path(sys.argv[1])
wheels = list(folder.glob("*.whl"))
if len(wheels) != 1:
    sys.exit(f"expected one wheel, found {len(wheels)}")
out = folder / "libraries"
out.mkdir()
with zipfile.ZipFile(wheels[0]) as wheel:
    for name in wheel.namelist():
        path = pathlib.PurePosixPath(name)
        if ".so" in path.name and path.parent.name.endswith(".libs"):
            (out / path.name).write_bytes(wheel.read(name))
for part in ("libembree4", "libtbb"):
    if len(list(out.glob(part + "*"))) != 1:
        sys.exit(f"no single {part} in {wheels[0].name}")
PYTHON
    if [ -e "$link" ] && [ ! -L "$link" ]; then
        die "$link is not from this script; choose another folder"
    fi
    # Only names that wheels have: the folder may hold other libraries.
    rm -f "$target"/libembree4-*.so.4 "$target"/libtbb-*.so.12 "$link" "$stamp"
    cp "$scratch"/libraries/* "$target"/
    chmod 755 "$target"/*.so*
    local real
    real="$(cd "$target" && echo libembree4-*.so.4)"
    [ -f "$target/$real" ] || die "no libembree4-*.so.4 among: $(ls "$target")"
    ln -s "$real" "$link"
    loads "$link" || die "$link does not load: $(python3 -c 'import ctypes, sys; ctypes.CDLL(sys.argv[1])' "$link" 2>&1 | tail -n 1)"
    printf '%s\n' "$PACKAGE" >"$stamp"
    say "installed $link"
}

install_system_embree
install_embree_4_4
printf 'export EMBREE_LIBRARY=%q\n' "$target/libembree4.so.4"
