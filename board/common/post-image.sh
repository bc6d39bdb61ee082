#!/bin/sh
# post-image.sh IMAGES BOARD: Buildroot calls it when the slot is packed. It makes the disk around it:
# images/disk.img, by genimage from genimage.cfg.in; images/slot.img is what an update brings.
set -eu
images=$1 board=$2
common=$(cd "$(dirname "$0")" && pwd)
inputs=$BUILD_DIR/disk-inputs
data_size=64M
export E2FSPROGS_FAKE_TIME="${SOURCE_DATE_EPOCH:?}" TZ=UTC

rm -rf "$inputs"
mkdir -p "$inputs/empty"
cp "$images/rootfs.squashfs" "$inputs/slot.img"
"$common/seal-slot.sh" "$inputs/slot.img"
cp "$common/../../package/odid-daemon/odid.conf.example" "$inputs/"

mkimage -A arm64 -T script -C none -n boot -d "$common/boot.cmd" "$inputs/boot.scr" >/dev/null
environment_size=$(sed -n 's/^CONFIG_ENV_SIZE=//p' "$common/u-boot.fragment")
for name in uboot.env uboot-redund.env; do
	mkenvimage -r -s "${environment_size:?}" -o "$inputs/$name" "$common/../$board/u-boot.env"
done
mke2fs -q -t ext4 -L data -U 0d1d2024-0000-4000-8000-000000000008 \
	-E hash_seed=0d1d2024-0000-4000-8000-000000000009,lazy_itable_init=0 "$inputs/data.ext4" "$data_size"

# What the BOOT volume holds: boot.scr, and what the board's boot-files names, one a line, out of the
# board's folder or of what Buildroot made.
boot_files='"boot.scr"'
if [ -e "$common/../$board/boot-files" ]; then
	while read -r name; do
		case $name in '' | '#'*) continue ;; esac
		for source in "$common/../$board/$name" "$images/$name"; do
			[ ! -e "$source" ] || break
		done
		[ -e "$source" ] || { echo "boot-files: there is no $name" >&2 && exit 1; }
		cp -R "$source" "$inputs/${name##*/}"
		boot_files="$boot_files, \"${name##*/}\""
	done <"$common/../$board/boot-files"
fi

# FAT keeps the files' times.
find "$inputs" -exec touch -h -d "@$SOURCE_DATE_EPOCH" {} +
sed "s|@BOOT_FILES@|$boot_files|" "$common/genimage.cfg.in" >"$BUILD_DIR/genimage.cfg"
rm -rf "$BUILD_DIR/genimage.tmp"
genimage --config "$BUILD_DIR/genimage.cfg" --inputpath "$inputs" --outputpath "$images" \
	--tmppath "$BUILD_DIR/genimage.tmp" --rootpath "$inputs/empty"
cp "$inputs/slot.img" "$images/"
