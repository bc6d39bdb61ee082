#!/bin/sh
# check-host.sh BOARD OUT SOURCES: whether an image can be made here: all that is missing at once,
# before hours are spent. What Buildroot itself needs beside this it says at its start.
set -eu
board=$1 out=$2 sources=$3
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

for folder in "$project" "$out" "$sources"; do
	case $folder in
	*[[:space:]]*) complain "$folder: Buildroot can't work in a folder with a space in its name" ;;
	esac
done

# One that was built once has its room.
if [ ! -e "$out/built" ]; then
	mkdir -p "$out"
	free_kib=$(df -P -k "$out" | awk 'NR == 2 { print $4 }')
	[ "$free_kib" -ge $((needed_gib * 1024 * 1024)) ] ||
		complain "$out: $((free_kib / 1024 / 1024)) GiB free, $needed_gib GiB are needed"
fi

[ -z "$wrong" ]
