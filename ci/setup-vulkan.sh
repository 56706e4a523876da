#!/usr/bin/env bash
# Installs the Vulkan loader and Mesa's software driver (lavapipe) on Debian; nothing to do elsewhere or twice.
set -euo pipefail
packages=(libvulkan1 mesa-vulkan-drivers)
command -v apt-get > /dev/null || { echo "no apt-get: install a Vulkan loader and Mesa's lavapipe by hand" >&2; exit 0; }
missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f '${Status}' "$package" 2> /dev/null | grep -q "ok installed" || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && { echo "Vulkan: already installed"; exit 0; }
root=()
[ "$(id -u)" = 0 ] || root=(sudo)
"${root[@]}" apt-get update -qq
DEBIAN_FRONTEND=noninteractive "${root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" > /dev/null
echo "Vulkan: installed ${missing[*]}"
