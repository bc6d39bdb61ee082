#!/bin/sh
# pack-release.sh BOARD OUT NAME: puts together what is handed on of an image that Buildroot has made in
# OUT: OUT/release with NAME.img.xz, its map for bmaptool, the bill of materials where one could be made, the
# licences, and SHA256SUMS of all of them.
set -eu
board=$1 out=$2 name=$3
release=$out/release
part=$release.part

rm -rf "$part"
mkdir -p "$part/licences"

# The map says which blocks hold something: zeros become holes first, wherever they came from.
cp --sparse=always "$out/images/disk.img" "$part/$name.img"
bmaptool -q create -o "$part/$name.img.bmap" "$part/$name.img"
# As many threads on every machine: how many there are is visible in the result.
xz -T4 "$part/$name.img"

# QEMU is given its boot loader as a file; on a board it is on the disk.
[ "$board" != qemu ] || cp "$out/images/u-boot.bin" "$part/"

[ ! -e "$out/sbom.json" ] || cp "$out/sbom.json" "$part/$name.sbom.json"
cp -R "$out/legal-info/licenses/." "$out/legal-info/manifest.csv" "$part/licences/"

(cd "$part" && find . -type f -printf '%P\n' | LC_ALL=C sort | xargs -d '\n' sha256sum) >"$part.sums"
mv "$part.sums" "$part/SHA256SUMS"
rm -rf "$release"
mv "$part" "$release"
echo "image: $release/$name.img.xz ($(stat -c %s "$release/$name.img.xz") octets)"
[ -e "$out/sbom.json" ] || echo "image: $name.sbom.json, the bill of materials, is missing in it: see above"
