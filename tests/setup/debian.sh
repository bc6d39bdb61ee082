#!/bin/sh
# Installs the Debian packages that are named, and missing; a name that ends with .txt is a list here.
# When nothing is missing it neither needs root nor touches the network.
set -eu
here=$(dirname "$0")

names=
for name; do
    case $name in
        *.txt) names="$names $(sed 's/#.*//' "$here/$name")" ;;
        *) names="$names $name" ;;
    esac
done
# shellcheck disable=SC2086 # a list
set -- $names

if ! command -v dpkg-query >/dev/null; then
    echo "set-up: not a Debian system; going on, but these must be there: $*" >&2
    exit 0
fi

missing=
for package; do
    case $(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true) in
        installed*) ;;
        *) missing="$missing $package" ;;
    esac
done
[ -n "$missing" ] || exit 0

if [ "$(id -u)" -ne 0 ]; then
    echo "set-up: Debian packages are missing. As root:" >&2
    echo "    apt-get update && apt-get install --no-install-recommends$missing" >&2
    exit 1
fi

echo "set-up: installing Debian packages:$missing"
log=build/setup/apt.log
mkdir -p build/setup
export DEBIAN_FRONTEND=noninteractive

# Waits for another apt that is at work; nothing reads a terminal.
apt() {
    apt-get -o DPkg::Lock::Timeout=300 -o Acquire::Retries=3 "$@" </dev/null >>"$log" 2>&1
}

# A foreign source that can't be reached fails the update, though Debian's own lists are fresh:
# whether the packages can be had, the installation finds out.
apt update || echo "set-up: apt-get update complained (see $log); trying all the same" >&2
# shellcheck disable=SC2086 # a list
if ! apt install --yes --no-remove --no-install-recommends $missing; then
    tail -n 20 "$log" >&2
    echo "set-up: apt-get could not install:$missing (whole log: $log)" >&2
    exit 1
fi
