#!/usr/bin/env bash
# Installs the Vulkan loader, Mesa's software driver (lavapipe) and the validation layers on Debian; nothing to do elsewhere or twice.
set -euo pipefail
packages=(libvulkan1 mesa-vulkan-drivers vulkan-validationlayers)
command -v apt-get > /dev/null || { echo "no apt-get: install a Vulkan loader and Mesa's lavapipe by hand" >&2; exit 0; }
missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f '${Status}' "$package" 2> /dev/null | grep -q "ok installed" || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && { echo "Vulkan: already installed"; exit 0; }
root=()
if [ "$(id -u)" != 0 ]; then
  command -v sudo > /dev/null || { echo "installing ${missing[*]} needs root: run this as root or install sudo" >&2; exit 1; }
  root=(sudo)
fi
"${root[@]}" apt-get update -qq
# Through env, since sudo drops the caller's variables.
"${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" > /dev/null
echo "Vulkan: installed ${missing[*]}"
