#!/bin/sh
# check-config.sh NAME GOT WANTED...: fails when an option that the files WANTED ask for is not in
# the configuration GOT: kconfig drops without a word what it doesn't know, or what something else is
# missing for. Of two lines about one option the last counts.
set -eu
name=$1 got=$2
shift 2

for file in "$got" "$@"; do
	if [ ! -s "$file" ]; then
		echo "$name: $file is missing or empty" >&2
		exit 1
	fi
done

lost=$(awk '
	function option() { return $1 == "#" ? $2 : substr($0, 1, index($0, "=") - 1) }
	!/^(# )?(BR2|CONFIG)_[A-Za-z0-9_]+(=| is not set$)/ { next }
	FILENAME == ARGV[1] { value[option()] = $0; next }
	{ wanted[option()] = $0 }
	END {
		for (o in wanted) {
			got = o in value ? value[o] : "# " o " is not set"
			off = wanted[o] ~ /^#/ || wanted[o] ~ /=n$/
			if (off ? got !~ /^#/ : got != wanted[o])
				print "  " wanted[o] "    got: " got
		}
	}' "$got" "$@" | sort)

if [ -n "$lost" ]; then
	echo "$name: these options were asked for and did not survive:" >&2
	echo "$lost" >&2
	exit 1
fi
