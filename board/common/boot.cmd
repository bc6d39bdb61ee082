# boot.cmd: starts one of the two slots. mkimage makes boot.scr of it; U-Boot's bootcmd runs that.
#
#   slot               the committed slot, a or b
#   upgrade_available  1 while `trial` is on trial; U-Boot counts starts in bootcount only then
#   trial_failed       set here: the slot whose trial failed last; kept for whoever asks why
#   trial_reason       set with it: three-restarts, or too-many-starts (the limit, see below)
#   unverified         odid-update's: the slot that is written to, where /data keeps no record of it
#   restarts           counted here: starts that weren't power-ons, so panics and hangs; switching
#                      off never counts. odid-update makes it 0 when it runs, on trial when all is well
#   disk, console, *_addr_r   the board's, from its u-boot.env
#   board_*            odid.conf's [board] keys, for the slot's /boot/board.scr
#   find_power_on      the board's: sets power_on to 1 when power was switched on just now
#   fit_tree           the machine's, where it has one: what else the kernel's device tree (now U-Boot's
#                      working one) has to say
#
# A slot holds kernel, device tree (/boot/board.dtb; none: the machine's own) and a script that fits
# the device tree to the board (/boot/board.scr), so that these always go together.
#
# What comes of it is on the kernel's command line: odid.slot=a|b, and odid.fallback=<why> when
# that isn't the slot that should have been started; odid.trial for a slot on trial.

if test "${slot}" != b; then setenv slot a; fi
setenv fallback

# Restarts are counted before everything else, because saveenv saves every variable there is.
if test -z "${restarts}"; then setenv restarts 0; fi
setenv power_on
run find_power_on
# A board that takes every start for a power-on has this limit.
if test "${upgrade_available}" = 1 && test ${bootcount} -gt ${bootlimit}; then
    setenv power_on 0
    setenv restarts 3
fi
if test "${power_on}" != 1; then
    setenv power_on
    setexpr restarts ${restarts} + 1
    if test ${restarts} -le 3; then
        saveenv
    elif test "${upgrade_available}" = 1; then
        setenv trial_failed ${trial}
        setenv trial_reason three-restarts
        if test ${bootcount} -gt ${bootlimit}; then setenv trial_reason too-many-starts; fi
        setenv trial
        setenv upgrade_available 0
        setenv bootcount 0
        setenv restarts 0
        saveenv
        setenv fallback slot-${trial_failed}-failed-its-trial
    else
        setenv restarts 0
        saveenv
        setenv fallback slot-${slot}-restarted-three-times
    fi
fi

setenv first ${slot}
if test "${upgrade_available}" = 1; then
    if test "${trial}" = a || test "${trial}" = b; then setenv first ${trial}; fi
fi
if test "${fallback}" = slot-a-restarted-three-times; then setenv first b; fi
if test "${fallback}" = slot-b-restarted-three-times; then setenv first a; fi

# A slot is read from end to end before it is started: damage anywhere in it, a program as well as
# the kernel, is a reason to take the other one. seal-slot.sh wrote its sha256 behind the squashfs,
# whose own head says how long it is (octets, at 0x28). `failure` says what is wrong with the slot,
# in words that fit the command line.
setenv check_slot '
setenv failure unreadable;
if read ${disk}:${part} ${kernel_addr_r} 0 8; then
    setexpr at ${kernel_addr_r} + 28;
    setexpr.l length *${at};
    setexpr length ${length} + fff;
    setexpr length ${length} / 1000;
    setexpr blocks ${length} * 8;
    setexpr blocks ${blocks} + 8;
    setexpr length ${length} * 1000;
    setexpr seal ${kernel_addr_r} + ${length};
    if read ${disk}:${part} ${kernel_addr_r} 0 ${blocks}; then
        setenv failure damaged;
        if hash -v sha256 ${kernel_addr_r} ${length} *${seal}; then setenv failure; fi;
    fi;
fi'

setenv start_slot '
setenv failure kernel-refused;
setenv initrd -;
setenv fdt ${fdtcontroladdr};
if test -e ${disk}:${part} /boot/initrd; then
    load ${disk}:${part} ${ramdisk_addr_r} /boot/initrd;
    setenv initrd ${ramdisk_addr_r}:${filesize};
fi;
if test -e ${disk}:${part} /boot/board.dtb; then
    load ${disk}:${part} ${fdt_addr_r} /boot/board.dtb;
    setenv fdt ${fdt_addr_r};
fi;
if test -e ${disk}:${part} /boot/board.scr; then
    load ${disk}:${part} ${scriptaddr} /boot/board.scr && source ${scriptaddr};
fi;
part uuid ${disk}:${part} partuuid;
setenv bootargs root=PARTUUID=${partuuid} ro rootfstype=squashfs rootwait panic=5 console=${console} ${board_bootargs} odid.slot=${try};
if test "${upgrade_available}" = 1 && test "${try}" = "${trial}"; then setenv bootargs ${bootargs} odid.trial; fi;
if test -n "${fallback}"; then setenv bootargs ${bootargs} odid.fallback=${fallback}; fi;
if test -n "${fit_tree}"; then fdt addr ${fdt} && run fit_tree; fi;
load ${disk}:${part} ${kernel_addr_r} /boot/Image && booti ${kernel_addr_r} ${initrd} ${fdt}'

# Comes back only when the slot can't be started.
setenv try_slot '
if test ${try} = a; then setenv part 6; else setenv part 7; fi;
run check_slot;
if test -z "${failure}"; then run start_slot; fi;
echo "boot: slot ${try}: ${failure}";
if test -n "${fallback}"; then setenv fallback ${fallback},; fi;
setenv fallback ${fallback}slot-${try}-${failure}'

setenv try ${first}
run try_slot
if test ${first} = a; then setenv try b; else setenv try a; fi
run try_slot

echo "boot: neither slot can be started, trying again in 10 s"
sleep 10
reset
