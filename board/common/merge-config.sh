#!/bin/sh
# merge-config.sh DEFCONFIG [FILE...]: prints the defconfig and the files together; of an option that
# several of them set, the last one's. The files say what is different on one machine (another
# toolchain, a mirror), or what somebody's own layer adds.
set -eu
awk '
	function option() { return $1 == "#" ? $2 : substr($0, 1, index($0, "=") - 1) }
	{ line++; is_option = /^(# )?BR2_[A-Za-z0-9_]+(=| is not set$)/ }
	pass == 1 { if (is_option) last[option()] = line; next }
	!is_option || last[option()] == line
' pass=1 "$@" pass=2 line=0 "$@"
