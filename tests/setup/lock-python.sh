#!/bin/sh
# Renews requirements.txt from requirements.in: the whole closure, each with the hashes of the
# wheels that Debian 12's Python installs on amd64 and arm64. For whoever changes a version;
# set-up doesn't run it.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
python=${PYTHON:-/usr/bin/python3}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

"$python" -m venv "$scratch/venv"
for machine in x86_64 aarch64; do
    # Debian 12 has glibc 2.36; pip wants each older platform named as well.
    set --
    for glibc in $(seq 36 -1 17); do
        set -- "$@" --platform "manylinux_2_${glibc}_$machine"
    done
    "$scratch/venv/bin/pip" install --quiet --disable-pip-version-check --dry-run \
        --ignore-installed --only-binary :all: --python-version 3.11 --target "$scratch/none" \
        "$@" --platform "manylinux2014_$machine" --platform "manylinux1_$machine" \
        --report "$scratch/$machine.json" -r "$here/requirements.in"
done

"$python" - "$scratch"/*.json >"$scratch/requirements.txt" <<'END'
import json
import sys

pins = {}
for path in sys.argv[1:]:
    with open(path, encoding="utf-8") as file:
        for item in json.load(file)["install"]:
            name = item["metadata"]["name"].lower().replace("_", "-")
            sha256 = item["download_info"]["archive_info"]["hashes"]["sha256"]
            pins.setdefault(f"{name}=={item['metadata']['version']}", set()).add(sha256)

print("# Made by lock-python.sh from requirements.in; change that one.")
for pin, hashes in sorted(pins.items()):
    print(" \\\n    ".join([pin] + [f"--hash=sha256:{sha256}" for sha256 in sorted(hashes)]))
END
mv "$scratch/requirements.txt" "$here/requirements.txt"
