#!/bin/sh
# bill-of-materials.sh SOURCES BUILDROOT OUT PROJECT VERSION <INFO: makes OUT/sbom.json, CycloneDX, of what Buildroot's
# show-info says. The image is whole without it: what keeps it from being made is said, and is no failure.
set -eu
sources=$1 buildroot=$2 out=$3 project=$4 version=$5
part=$out/sbom.json.part

rm -f "$out/sbom.json"
"${0%/*}/licence-names.sh" "$sources" "$buildroot" || exit 0
if BR2_DL_DIR=$sources "$buildroot/utils/generate-cyclonedx" --project-name "$project" \
	--project-version "$version" -o "$part"; then
	mv "$part" "$out/sbom.json"
else
	rm -f "$part"
	echo "bill of materials: $buildroot/utils/generate-cyclonedx failed, see above: the image goes without one" >&2
fi
