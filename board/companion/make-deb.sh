#!/bin/sh
# make-deb.sh ARCHITECTURE OUT: builds Debian's package for companion computers, OUT/odid_VERSION_ARCHITECTURE.deb.
# OPENDRONEID, MAVLINK: the two foreign sources. The same commit, the same bytes.
set -eu
here=$(cd "$(dirname "$0")/../.." && pwd)
architecture=$1
mkdir -p "$2"
out=$(cd "$2" && pwd)
work=$out/$architecture
daemon=$here/package/odid-daemon

version=$(sed -n 's/^project.odid-daemon VERSION \([0-9.]*\).*/\1/p' "$daemon/CMakeLists.txt")
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git -C "$here" log -1 --format=%ct 2>/dev/null || stat -c %Y "$daemon/CMakeLists.txt")}
export SOURCE_DATE_EPOCH
# Its debugging symbols are as large as the rest, and nobody has asked for them.
DEB_BUILD_OPTIONS="noautodbgsym nocheck parallel=$(nproc)"
export DEB_BUILD_OPTIONS
unset MAKEFLAGS MFLAGS MAKELEVEL

# Made once of the same.
deb=$out/odid_${version}_$architecture.deb
made_of=$({
    cd "$here"
    echo "$SOURCE_DATE_EPOCH"
    find "$OPENDRONEID" "$MAVLINK" package/odid-daemon/CMakeLists.txt package/odid-daemon/odid.conf.example package/odid-daemon/src \
        package/odid-daemon/man package/odid-daemon/debian overlay/etc/hostapd/hostapd.conf.in board/companion/make-deb.sh \
        -type f | sort | xargs sha256sum
} | sha256sum)
if [ -e "$deb" ] && [ "$made_of" = "$(cat "$out/$architecture.made-of" 2>/dev/null)" ]; then
    echo "deb: $deb"
    exit 0
fi

rm -rf "$work"
mkdir -p "$work/odid/third-party/opendroneid" "$work/odid/third-party/mavlink"
for part in CMakeLists.txt odid.conf.example src man debian; do
    cp -R "$daemon/$part" "$work/odid/"
done
cp "$OPENDRONEID"/opendroneid.[ch] "$work/odid/third-party/opendroneid/"
cp -R "$MAVLINK/." "$work/odid/third-party/mavlink/"
cp "$here/overlay/etc/hostapd/hostapd.conf.in" "$work/odid/debian/companion/"
cat >"$work/odid/debian/changelog" <<END
odid ($version) bookworm; urgency=medium

  * Built from the project's own source; what has changed is in its history.

 -- $(sed -n 's/^Maintainer: //p' "$daemon/debian/control")  $(date -u -R -d "@$SOURCE_DATE_EPOCH")
END
# Whatever the umask here.
chmod -R u=rwX,go=rX "$work/odid"

set -- --build=binary --no-sign --host-arch="$architecture"
if [ "$architecture" != "$(dpkg --print-architecture)" ]; then
    "$here/tests/setup/cross-libraries.sh" "$architecture" "$work/libraries"
    root=$work/libraries/root
    triplet=$(dpkg-architecture -a"$architecture" -qDEB_HOST_MULTIARCH)
    export PKG_CONFIG_LIBDIR="$root/usr/lib/$triplet/pkgconfig" PKG_CONFIG_SYSROOT_DIR="$root" PKG_CONFIG_PATH=
    export DEB_CFLAGS_APPEND="-isystem $root/usr/include"
    export DEB_LDFLAGS_APPEND="-L$root/usr/lib/$triplet -Wl,-rpath-link,$root/usr/lib/$triplet"
    export CMAKE="-DPKG_CONFIG_EXECUTABLE=/usr/bin/pkg-config"
    export SHLIBDEPS="--admindir=$work/libraries/dpkg -l$root/usr/lib/$triplet"
    set -- "$@" --no-check-builddeps
fi
if ! (cd "$work/odid" && dpkg-buildpackage "$@") >"$work/log" 2>&1 </dev/null; then
    tail -n 30 "$work/log" >&2
    echo "deb: the whole log: $work/log" >&2
    exit 1
fi
rm -f "$out"/odid_*_"$architecture.deb"
mv "$work/${deb##*/}" "$deb"
echo "$made_of" >"$out/$architecture.made-of"
echo "deb: $deb"
