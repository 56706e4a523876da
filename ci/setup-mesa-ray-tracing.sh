#!/usr/bin/env bash
# Fetches a software Vulkan driver with ray tracing (lavapipe of Mesa 25) into DIR, beside whatever the system has, so
# that the comparison with a driver's own ray tracing is tested without a GPU. Debian 12 has it in bookworm-backports.
#
#   ci/setup-mesa-ray-tracing.sh DIR    [default: peers/mesa under the repository]
#
# Installs nothing on the system, needs no root and does nothing twice. The last lines printed are settings that make
# a Vulkan loader use the driver:
#
#   eval "$(ci/setup-mesa-ray-tracing.sh | grep ^export)"
#
# Where it cannot be had (another system, no network), one line says why, and the exit code is 1.
set -euo pipefail

say() { printf 'setup-mesa-ray-tracing: %s\n' "$*" >&2; }
die() {
    say "no driver with ray tracing: $*"
    exit 1
}

[ "$#" -le 1 ] || die "expected at most one argument, a folder"
repository="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
target="${1:-$repository/peers/mesa}"
mkdir -p "$target" || die "cannot make the folder $target"
target="$(cd "$target" && pwd)"
manifest="$target/lavapipe.json"

settings() {
    printf 'export VK_DRIVER_FILES=%q VK_ICD_FILENAMES=%q\n' "$manifest" "$manifest"
    # Libraries that the driver needs and the system has not, or has too old.
    printf 'export LD_LIBRARY_PATH=%q${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}\n' "$target/libraries"
}
if [ -s "$manifest" ]; then
    say "$manifest is there"
    settings
    exit 0
fi

command -v apt-get > /dev/null && command -v dpkg > /dev/null || die "this is no Debian"
codename="$(. /etc/os-release && printf '%s' "${VERSION_CODENAME:-}")"
[ "$codename" = bookworm ] || die "this is not Debian 12 (bookworm), for which this script is made"
architecture="$(dpkg --print-architecture)"

scratch="$(mktemp -d)"
trap 'rm -rf "$scratch"' EXIT
# The mirror that the system uses, with the one suite that it does not.
mirror="$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' "Codename: $codename" 2> /dev/null | head -n 1 || true)"
mirror="${mirror:-http://deb.debian.org/debian/}"
keys=/usr/share/keyrings/debian-archive-keyring.gpg
signed=""
[ -r "$keys" ] && signed="[signed-by=$keys]"
mkdir -p "$scratch/lists/partial" "$scratch/archives" "$scratch/tree"
for suite in "$codename" "$codename-backports"; do
    printf 'deb %s %s %s main\n' "$signed" "$mirror" "$suite"
done > "$scratch/sources.list"
options=(
    -qq
    -o "Dir::Etc::sourcelist=$scratch/sources.list"
    -o Dir::Etc::sourceparts=-
    -o "Dir::State::lists=$scratch/lists"
    -o "Dir::Cache::pkgcache=" -o "Dir::Cache::srcpkgcache="
    -o APT::Sandbox::User=
    -o Acquire::Retries=2
    -o APT::Update::Error-Mode=any
)
say "reading the lists of $codename-backports"
apt-get "${options[@]}" update > "$scratch/log" 2>&1 || die "apt-get update failed: $(grep -m 1 '^[EW]:' "$scratch/log" || true)"

# Unpacks a package: the backport where there is one.
fetch() {
    (cd "$scratch/archives" && apt-get "${options[@]}" download -t "$codename-backports" "$1") >> "$scratch/log" 2>&1 || return 1
    dpkg -x "$scratch/archives/$1"_*.deb "$scratch/tree"
}
fetch mesa-vulkan-drivers || die "mesa-vulkan-drivers could not be fetched: $(tail -n 1 "$scratch/log")"
libraries="$scratch/tree/usr/lib/$(dpkg-architecture -qDEB_HOST_MULTIARCH 2> /dev/null || echo "$(uname -m)-linux-gnu")"
driver="$libraries/libvulkan_lvp.so"
[ -f "$driver" ] || die "the package has no libvulkan_lvp.so"

# What it depends on, as far as the system lacks it: ldd says which libraries are missing or too old.
missing() { LD_LIBRARY_PATH="$libraries" ldd "$driver" 2>&1 | grep -E 'not found|no version information' || true; }
if [ -n "$(missing)" ]; then
    depends="$(dpkg-deb -f "$scratch/archives"/mesa-vulkan-drivers_*.deb Depends \
        | tr ',' '\n' | sed -E 's/[|(].*//; s/:any//; s/ //g' | grep -vE '^(libc6|libgcc-s1|libstdc\+\+6|python3)?$')"
    for package in $depends; do
        [ -n "$(missing)" ] || break
        say "fetching $package"
        fetch "$package" || say "warning: $package could not be fetched"
    done
fi
[ -z "$(missing)" ] || die "libraries are missing: $(missing | head -n 3 | tr '\n' ';')"

rm -rf "$target/libraries"
mkdir -p "$target/libraries"
# The other drivers of the package stay out.
find "$libraries" -maxdepth 1 -name '*.so*' ! -name 'libVkLayer_*' ! -name 'libvulkan_*' -exec cp -a {} "$target/libraries/" \;
cp -a "$driver" "$target/libraries/"
version="$(dpkg-deb -f "$scratch/archives"/mesa-vulkan-drivers_*.deb Version)"
cat > "$manifest" << JSON
{"file_format_version": "1.0.0", "ICD": {"library_path": "$target/libraries/libvulkan_lvp.so", "api_version": "1.4.0"}}
JSON
say "Mesa $version for $architecture is in $target"
settings
