#!/bin/sh
# Fetches a QEMU that has the machine raspi4b, from Debian 12's backports: only its program, into
# build/qemu-raspi.
set -eu
. "$(dirname "$0")/own-apt.sh"
out=$PWD/build/qemu-raspi
program=$out/usr/bin/qemu-system-aarch64
[ ! -x "$program" ] || exit 0

rm -rf "$out.part"
mkdir -p "$out.part"
cd "$out.part"
if ! own_apt deb bookworm-backports || ! apt-get -q download qemu-system-arm >>log 2>&1; then
    cat log >&2
    echo "set-up: QEMU could not be fetched from Debian's backports" >&2
    exit 1
fi
dpkg-deb -x qemu-system-arm_*.deb unpacked
rm -rf "$out"
mv unpacked "$out"
cd "$out"
rm -rf "$out.part"
if ! "$program" -M help | grep -q raspi4b; then
    echo "set-up: $program has no machine raspi4b" >&2
    exit 1
fi
