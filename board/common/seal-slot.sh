#!/bin/sh
# seal-slot.sh SLOT: appends to a slot's squashfs (padded to 4096 octets, as mksquashfs does) the
# block that boot.cmd checks it by: sha256 of all before, 32 octets, padded with zeros to 4096.
set -eu
slot=$1
size=$(stat -c %s "$slot")
if [ $((size % 4096)) -ne 0 ]; then
    echo "$slot: $size octets, expected a multiple of 4096" >&2
    exit 1
fi
sha256=$(sha256sum "$slot")
printf %.64s "$sha256" | xxd -r -p >>"$slot"
truncate -s %4096 "$slot"
