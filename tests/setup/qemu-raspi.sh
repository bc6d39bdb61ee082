#!/bin/sh
# Fetches a QEMU that has the machine raspi4b, from Debian 12's backports: only its program, into
# build/qemu-raspi, by an apt state of its own; this machine's own QEMU stays what it is.
set -eu
out=$PWD/build/qemu-raspi
program=$out/usr/bin/qemu-system-aarch64
[ ! -x "$program" ] || exit 0

# shellcheck disable=SC2016 # it is apt that fills it in
mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Codename: bookworm' | head -n 1)
rm -rf "$out.part"
mkdir -p "$out.part/state/lists/partial" "$out.part/cache/archives/partial"
cd "$out.part"
echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] ${mirror:?no Debian 12 in the sources of apt} bookworm-backports main" >sources.list
cat >apt.conf <<END
Dir::Etc::sourcelist "$PWD/sources.list";
Dir::Etc::sourceparts "/dev/null";
Dir::State::lists "$PWD/state/lists";
Dir::Cache "$PWD/cache";
APT::Sandbox::User "";
END
export APT_CONFIG="$PWD/apt.conf"
if ! apt-get -q update >log 2>&1 || ! apt-get -q download qemu-system-arm >>log 2>&1; then
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
