#!/bin/sh
# make-bundle.sh SLOT BOARD VERSION KEYS BUNDLE: makes an update of a sealed slot: its description
# (sw-description.in), the signature over that, made with KEYS/signing.key, and the slot itself.
set -eu
slot=$1 board=$2 version=$3 keys=$4 bundle=$5
common=$(cd "$(dirname "$0")" && pwd)

for file in "$slot" "$keys/signing.key" "$keys/signing.crt"; do
	if [ ! -r "$file" ]; then
		echo "make-bundle.sh: $file can't be read" >&2
		exit 1
	fi
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

sha256=$(sha256sum <"$slot")
sed -e '/^#/d' \
	-e "s/@VERSION@/$version/" -e "s/@BOARD@/$board/" \
	-e "s/@SHA256@/${sha256%% *}/" -e "s/@OCTETS@/$(stat -L -c %s "$slot")/" \
	"$common/sw-description.in" >"$work/sw-description"
openssl cms -sign -binary -nosmimecap -outform DER -md sha256 -signer "$keys/signing.crt" \
	-inkey "$keys/signing.key" -in "$work/sw-description" -out "$work/sw-description.sig"
ln -s "$(realpath "$slot")" "$work/slot.img"

# In this order: SWUpdate reads it as it comes.
cd "$work"
touch -d "@${SOURCE_DATE_EPOCH:-0}" sw-description sw-description.sig
printf '%s\n' sw-description sw-description.sig slot.img |
	cpio --quiet -o -L -H crc --reproducible -R 0:0 >bundle
cd "$OLDPWD"
mkdir -p "$(dirname "$bundle")"
mv "$work/bundle" "$bundle"
