#!/bin/sh
# compare-images.sh OUT OTHER: fails when two builds of one image (make image) differ, and says in
# which files. With diffoscope installed, OTHER/difference.txt says in what.
set -eu
one=$1 other=$2

if [ "$(wc -l <"$one/release/SHA256SUMS")" -gt 2 ] &&
	cmp -s "$one/release/SHA256SUMS" "$other/release/SHA256SUMS"; then
	echo "reproducible: $(wc -l <"$one/release/SHA256SUMS") files, the image among them, are the same in both builds"
	exit 0
fi

echo "not reproducible: these files of the release differ:"
diff "$one/release/SHA256SUMS" "$other/release/SHA256SUMS" | sed -n 's/^[<>] [0-9a-f]*  /  /p' | sort -u

# The slot's files, one by one.
scratch=$other/compare
rm -rf "$scratch"
mkdir -p "$scratch"
unsquashfs -q -n -d "$scratch/one" "$one/images/rootfs.squashfs" >/dev/null
unsquashfs -q -n -d "$scratch/other" "$other/images/rootfs.squashfs" >/dev/null
echo "in the slot:"
diff -r -q --no-dereference "$scratch/one" "$scratch/other" | sed "s|$scratch/||g; s/^/  /" || true
if command -v diffoscope >/dev/null; then
	diffoscope --text "$other/difference.txt" "$scratch/one" "$scratch/other" || true
	echo "diffoscope: $other/difference.txt"
fi
exit 1
