#!/bin/sh
# check-host.sh BOARD SOURCES OUT...: whether an image can be made here, in each OUT: all that is missing at
# once, before hours are spent. What Buildroot itself needs beside this it says at its start.
set -eu
board=$1 sources=$2
shift 2
needed_gib=10
project=$(cd "$(dirname "$0")/../.." && pwd)
wrong=''

complain() {
	echo "image: $1" >&2
	wrong=yes
}

if [ ! -e "$project/configs/odid_${board}_defconfig" ]; then
	boards=$(cd "$project/configs" && echo odid_*_defconfig | sed 's/odid_\([a-z0-9]*\)_defconfig/\1/g; s/ /, /g')
	complain "BOARD=$board: there is no such board; expected one of: $boards"
fi

for program in bmaptool git openssl make gcc g++ perl python3 rsync cpio bc unzip wget file xxd xz; do
	command -v $program >/dev/null || complain "$program is not installed"
done

for folder in "$project" "$sources" "$@"; do
	case $folder in
	*[[:space:]]*) complain "$folder: Buildroot can't work in a folder with a space in its name" ;;
	esac
done

# One that was built once has its room.
all_gib=0
for out; do
	[ -e "$out/built" ] || all_gib=$((all_gib + needed_gib))
done
mkdir -p "$1"
free_kib=$(df -P -k "$1" | awk 'NR == 2 { print $4 }')
[ "$free_kib" -ge $((all_gib * 1024 * 1024)) ] ||
	complain "$1: $((free_kib / 1024 / 1024)) GiB free, $all_gib GiB are needed"

[ -z "$wrong" ]
