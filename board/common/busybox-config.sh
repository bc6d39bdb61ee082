#!/bin/sh
# busybox-config.sh: configures the BusyBox source tree in the current directory with what
# busybox.fragment names and nothing else. Fails when a line of the fragment did not survive.
# BusyBox' own allnoconfig ignores KCONFIG_ALLCONFIG, so everything else is switched off by name.
set -eu
fragment=$(cd "$(dirname "$0")" && pwd)/busybox.fragment

make -s allyesconfig >/dev/null 2>&1
: >.config.off
# Twice: allyesconfig makes it static, and hides what a static BusyBox can't have.
for _ in 1 2; do
    sed -n 's/^\(CONFIG_[A-Z0-9_a-z]*\)=y$/# \1 is not set/p' .config >>.config.off
    {
        grep '^CONFIG_' "$fragment"
        sed -n 's/^\(CONFIG_[A-Z0-9_a-z]*\)=.*/# \1 is not set/p' "$fragment" |
            grep -vxFf - .config.off
    } >.config
    yes '' | make -s oldconfig >/dev/null 2>&1
done

lost=$(grep '^CONFIG_' "$fragment" | grep -vxFf .config || true)
if [ -n "$lost" ]; then
    echo "busybox.fragment: BusyBox' configuration did not take over:" >&2
    echo "$lost" >&2
    exit 1
fi
