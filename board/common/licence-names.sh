#!/bin/sh
# licence-names.sh SOURCES BUILDROOT: has the list of licences' names, which the bill of materials is made with, in
# SOURCES. Buildroot's generate-cyclonedx would fetch it itself, without a hash, when all else is done.
set -eu
sources=$1 buildroot=$2
version=1.6
sha256=baa9d3bd1ed57b6751b0887edead6b5063ff53ff7429cf85d476c6c94af0166e # computed from the specification's tag 1.6
url=https://raw.githubusercontent.com/CycloneDX/specification/$version/schema/spdx.schema.json
file=$sources/cyclonedx/spdx-$version.schema.json

if ! grep -qx "CYCLONEDX_VERSION = \"$version\"" "$buildroot/utils/generate-cyclonedx"; then
	echo "licence names: $buildroot wants another version of the list than $version, which has no hash here ($0)" >&2
	exit 1
fi
is_right() {
	echo "$sha256  $1" | sha256sum --status -c -
}

[ ! -e "$file" ] || is_right "$file" || { echo "licence names: $file is not what it should be: fetched again" >&2; rm "$file"; }
[ ! -e "$file" ] || exit 0
mkdir -p "${file%/*}"
if ! wget -q --tries=2 --timeout=20 -O "$file.part" "$url"; then
	echo "licence names: $url could not be fetched" >&2
elif ! is_right "$file.part"; then
	echo "licence names: $url has the sha256 $(sha256sum "$file.part" | cut -d ' ' -f 1), expected $sha256" >&2
else
	mv "$file.part" "$file"
	exit 0
fi
rm -f "$file.part"
echo "licence names: without $file there is no bill of materials" >&2
exit 1
