#!/bin/sh
# level.sh LEVEL COMMAND...: one level of the tests; several may run at the same time. What it says goes into
# build/test/LEVEL.log, and is shown when it fails. LEVEL.exit is its exit code when that isn't 0: the summary
# counts it, so that a level that fails doesn't keep the next one from running.
level=$1
shift
log=build/test/$level.log
echo "$level: begins"
started=$(date +%s)
"$@" >"$log" 2>&1 </dev/null || {
    echo $? >"build/test/$level.exit"
    cat "$log"
}
echo "$level: ended after $(($(date +%s) - started)) s; $log"
