#!/bin/sh
# merge-config.sh DEFCONFIG [FILE]: prints the defconfig, with FILE's options in place of its own.
# FILE says what is different on one machine: another toolchain, a mirror, an override file.
set -eu
if [ $# -eq 1 ]; then
	exec cat "$1"
fi
awk '
	function option() { return $1 == "#" ? $2 : substr($0, 1, index($0, "=") - 1) }
	/^(# )?BR2_[A-Za-z0-9_]+(=| is not set$)/ {
		if (FILENAME == ARGV[1]) other[option()] = 1
		else if (option() in other) next
	}
	FILENAME != ARGV[1]' "$2" "$1"
cat "$2"
