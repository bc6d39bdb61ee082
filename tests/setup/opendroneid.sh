#!/bin/sh
# Fetches opendroneid-core-c into build/opendroneid, as vendored in the crate that opendroneid/
# pins (Cargo.lock has the crate's checksum, opendroneid.sha256 that of the files we use).
# OPENDRONEID_DIR= for make names a checkout instead.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out=$(pwd)/build/opendroneid
vendor=$(pwd)/build/setup/crates

# Older ones (Debian's package "cargo" among them) can't read today's manifests and index. A
# cargo on the PATH may also be a shim with no toolchain behind it: it has to answer.
recent_cargo() {
    version=$(cargo --version 2>/dev/null | sed -n 's/^cargo 1\.\([0-9]*\)\..*/\1/p')
    [ "${version:-0}" -ge 85 ]
}

if ! recent_cargo; then
    "$here/debian.sh" cargo-web || true
    PATH=/usr/bin:$PATH
    if ! recent_cargo; then
        echo "set-up: cargo 1.85 or newer is needed, or OPENDRONEID_DIR=<checkout>" >&2
        exit 1
    fi
fi

echo "set-up: opendroneid-core-c into build/opendroneid"
rm -rf "$vendor" "$out"
if ! cargo vendor --quiet --locked --manifest-path "$here/opendroneid/Cargo.toml" "$vendor" \
    >/dev/null; then
    echo "set-up: cargo could not fetch what $here/opendroneid/Cargo.lock pins" >&2
    exit 1
fi
mkdir -p "$out"
cp "$vendor"/opendroneid-sys/vendor/opendroneid-core-c/libopendroneid/opendroneid.[ch] "$out"
rm -rf "$vendor"
if ! (cd "$out" && sha256sum --quiet --check "$here/opendroneid.sha256"); then
    echo "set-up: opendroneid-core-c differs from what $here/opendroneid.sha256 pins" >&2
    rm -rf "$out"
    exit 1
fi
