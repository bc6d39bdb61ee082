#!/bin/sh
# Makes build/venv with exactly what requirements.txt pins, hashes checked, wheels only. What is behind its links
# lies in FETCHED, for all checkouts.
# PYTHON= names another Python 3.11 than Debian's.
set -eu
here=$(dirname "$0")
venv=build/venv
python=${PYTHON:-/usr/bin/python3}

# The pinned wheels are for one Python.
if ! "$python" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))'; then
    echo "set-up: $python is not Python 3.11 (Debian 12's); name one with PYTHON=" >&2
    exit 1
fi

# Named by what it is made of. Of its programs only python3 is used: the others name the folder they were made in.
packages=$FETCHED/python-$({ echo "$python" && cat "$here/requirements.txt"; } | sha256sum | cut -c -16)
if [ ! -e "$packages" ]; then
    echo "set-up: Python packages into $packages"
    mkdir -p "$FETCHED"
    work=$(mktemp -d "$packages.XXXXXX")
    trap 'rm -rf "$work"' EXIT
    "$python" -m venv "$work"
    # Compiled when first imported: MAVLink's modules alone are many megabytes, of which we use one.
    if ! "$work/bin/python3" -m pip install --quiet --disable-pip-version-check --no-compile \
        --only-binary :all: --require-hashes -r "$here/requirements.txt"; then
        echo "set-up: pip could not install what $here/requirements.txt pins" >&2
        exit 1
    fi
    chmod 755 "$work"
    # Another checkout may have been quicker.
    mv -T "$work" "$packages" || [ -e "$packages" ]
fi
rm -rf "$venv"
mkdir -p "$venv"
ln -s "$packages"/* "$venv"
