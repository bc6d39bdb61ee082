#!/bin/sh
# cross-libraries.sh ARCHITECTURE OUT: the libraries of Debian 12 that the companion's package is built with on a machine of
# another architecture. OUT/root has them unpacked; OUT/dpkg says which package each is of, for dpkg-shlibdeps.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
architecture=$1
mkdir -p "$2"
out=$(cd "$2" && pwd)
names='libc6 libbluetooth3 libbluetooth-dev libcap-ng-dev libcap-ng0 libinih-dev libinih1 libjson-c-dev libjson-c5 libseccomp-dev
    libseccomp2 nettle-dev libnettle8 libnl-3-dev libnl-3-200 libnl-genl-3-dev libnl-genl-3-200'
fetched=${FETCHED:-${XDG_CACHE_HOME:-$HOME/.cache}/odid}/companion-$architecture

# Another checkout waits meanwhile.
mkdir -p "$fetched"
exec 9>"$fetched/lock"
flock 9
# shellcheck disable=SC2086 # a list
all_there() {
    for name in $names; do
        set -- "$fetched/${name}_"*.deb
        [ -e "$1" ] || return 1
    done
}
if ! all_there; then
    echo "set-up: Debian's libraries for $architecture"
    . "$here/own-apt.sh"
    (
        cd "$fetched"
        own_apt deb bookworm "$architecture"
        # shellcheck disable=SC2086 # a list
        apt-get -q download $names >>log 2>&1 || { tail -n 5 log >&2; exit 1; }
    )
fi

rm -rf "$out/root" "$out/dpkg"
mkdir -p "$out/root/usr/lib" "$out/root/usr/bin" "$out/root/usr/sbin" "$out/dpkg/info" "$out/dpkg/updates"
echo 1 >"$out/dpkg/info/format" # files are named with their architecture
for folder in lib bin sbin; do
    ln -s "usr/$folder" "$out/root/$folder"
done
for name in $names; do
    deb=$(find "$fetched" -maxdepth 1 -name "${name}_*.deb" | sort | tail -n 1)
    dpkg-deb --fsys-tarfile "$deb" | tar -x --keep-directory-symlink --no-same-owner -C "$out/root"
    # As if it were installed there: its paths are where it really lies.
    {
        dpkg-deb -f "$deb" | sed '1a Status: install ok installed'
        echo
    } >>"$out/dpkg/status"
    of=$out/dpkg/info/$name:$architecture
    dpkg-deb -c "$deb" | sed -n "s|^[-l].* \./\([^ ]*\)\( -> .*\)\{0,1\}$|$out/root/\1|p" >"$of.list"
    # /lib is /usr/lib there: by either name.
    sed -i "s|^\($out/root\)\(/lib/.*\)|&\n\1/usr\2|" "$of.list"
    dpkg-deb -e "$deb" "$out/control"
    for file in symbols shlibs; do
        [ ! -e "$out/control/$file" ] || cp "$out/control/$file" "$of.$file"
    done
    rm -rf "$out/control"
done
# Links that lead from the top lead into this machine's own libraries.
find "$out/root/usr/lib" -type l -lname '/*' | while read -r link; do
    ln -sf "$out/root$(readlink "$link")" "$link"
done
