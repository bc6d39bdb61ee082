#!/bin/sh
# Builds the release's SWUpdate for this machine, into build/swupdate: its version and its configuration, with the layer's
# patches (br2-external/patches). The sources, and those of the libubootenv that it needs, are Debian 13's; they are kept in
# FETCHED.
set -eu
. "$(dirname "$0")/own-apt.sh"
project=$PWD
out=$PWD/build/swupdate
version=2024.12.1
archives=$FETCHED/swupdate-$version

fetch() {
    rm -rf "$archives.part"
    mkdir -p "$archives.part"
    cd "$archives.part"
    if ! own_apt deb-src trixie || ! apt-get -q source --tar-only swupdate libubootenv >>log 2>&1; then
        cat log >&2
        echo "set-up: SWUpdate's sources could not be fetched from Debian 13" >&2
        exit 1
    fi
    set -- swupdate_$version*.orig.tar.xz
    if [ ! -e "$1" ]; then
        echo "set-up: Debian 13 has another SWUpdate than the release's, $version" >&2
        exit 1
    fi
    rm -rf state cache sources.list apt.conf log
    rm -rf "$archives"
    mv "$archives.part" "$archives"
}

build() {
    tar xf "$archives"/libubootenv_*.orig.tar.xz
    tar xf "$archives"/swupdate_*.orig.tar.xz
    environment=$PWD/$(echo libubootenv-*)
    cmake -S "$environment" -B "$environment/out" -DBUILD_DOC=OFF
    cmake --build "$environment/out" --target ubootenv_static
    cd swupdate-$version
    for patch in "$project"/br2-external/patches/swupdate/*.patch; do
        patch -p1 <"$patch"
    done
    cp "$project/board/common/swupdate.fragment" .config
    cat >>.config <<END
CONFIG_EXTRA_CFLAGS="-I$environment/src"
CONFIG_EXTRA_LDFLAGS="-L$environment/out/src"
CONFIG_EXTRA_LDLIBS="yaml"
END
    # What Buildroot doesn't build it with either, whatever this machine has.
    export HAVE_LUA=n HAVE_LIBARCHIVE=n HAVE_LIBMTD=n HAVE_LIBUBI=n HAVE_LIBSYSTEMD=n HAVE_ZSTD=n
    yes '' | make oldconfig
    make -j "$(nproc)" swupdate_unstripped
}

[ -d "$archives" ] || (fetch)
echo "set-up: SWUpdate $version into build/swupdate"
rm -rf "$out"
mkdir -p "$out"
cd "$out"
# In a condition -e would hold for nothing of it, and a patch that doesn't apply be passed over.
set +e
(
    set -e
    build
) >log 2>&1
status=$?
set -e
if [ $status != 0 ]; then
    tail -n 20 log >&2
    echo "set-up: SWUpdate could not be built; build/swupdate/log" >&2
    exit 1
fi
mv swupdate-$version/swupdate_unstripped swupdate
rm -rf swupdate-$version libubootenv-*
