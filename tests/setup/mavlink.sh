#!/bin/sh
# Generates MAVLink's C headers into build/mavlink, from the definitions that pymavlink ships.
# Needs build/venv. MAVLINK_DIR= for make names ready headers instead.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
venv=$(pwd)/build/venv
out=$(pwd)/build/mavlink
export PYTHONPYCACHEPREFIX=build/pycache # what lies behind build/venv is every checkout's

echo "set-up: MAVLink headers into build/mavlink"
definitions=$("$venv/bin/python3" -c \
    'import os, pymavlink; print(os.path.join(pymavlink.__path__[0], "dialects", "v20"))')
if ! (cd "$definitions" && sha256sum --quiet --check "$here/mavlink.sha256"); then
    echo "set-up: MAVLink's definitions differ from those that $here/mavlink.sha256 pins" >&2
    exit 1
fi
rm -rf "$out"
mkdir -p build/setup
if ! "$venv/bin/python3" -m pymavlink.tools.mavgen --lang C --wire-protocol 2.0 \
    -o "$out" "$definitions/common.xml" >build/setup/mavgen.log 2>&1; then
    cat build/setup/mavgen.log >&2
    echo "set-up: mavgen failed" >&2
    exit 1
fi
