#!/bin/sh
# Fetches a QEMU that has the machine raspi4b, from Debian 12's backports, into build/qemu-raspi: its program, and the modules
# that belong to that very build (a USB device on a socket is one). The packages are kept in FETCHED.
set -eu
. "$(dirname "$0")/own-apt.sh"
out=$PWD/build/qemu-raspi
packages=${FETCHED:?make names it}/qemu-raspi
program=$out/usr/bin/qemu-system-aarch64

fetch() {
    rm -rf "$packages.part"
    mkdir -p "$packages.part"
    cd "$packages.part"
    if ! own_apt deb bookworm-backports || ! apt-get -q download qemu-system-arm qemu-system-common >>log 2>&1; then
        cat log >&2
        echo "set-up: QEMU could not be fetched from Debian's backports" >&2
        exit 1
    fi
    rm -rf state cache sources.list apt.conf log "$packages"
    mv "$packages.part" "$packages"
}

modules() {
    ls -d "$out"/usr/lib/*/qemu >/dev/null 2>&1
}

[ ! -x "$program" ] || ! modules || exit 0
[ -d "$packages" ] || (fetch)
rm -rf "$out.part"
mkdir -p "$out.part"
for package in "$packages"/*.deb; do dpkg-deb -x "$package" "$out.part"; done
rm -rf "$out"
mv "$out.part" "$out"
if ! "$program" -M help | grep -q raspi4b; then
    echo "set-up: $program has no machine raspi4b" >&2
    exit 1
fi
