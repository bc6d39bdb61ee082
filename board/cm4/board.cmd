# board.cmd: fits the slot's device tree to this very board. mkimage makes /boot/board.scr of it, in the
# slot, beside the device tree whose paths it knows; boot.cmd runs it.
#
#   fdtcontroladdr   the firmware's device tree: what it has found on this board
#   fdt_addr_r       the slot's, which the kernel gets
#   board_antenna, board_usb, board_uarts, board_console
#                    odid.conf's [board] keys, kept in the environment by /lib/odid/board-settings
#   console          the kernel's; changed here when board_console says so
#
# Memory, dma-ranges and the kernel's random seed U-Boot itself copies from the firmware's tree.

# Six octets of a property, as "a b c d e f"; nothing when it isn't there.
setenv read_octets '
setenv octets;
if fdt get addr at ${node} ${property}; then
    for i in 0 1 2 3 4 5; do
        setexpr.b octet *${at};
        setenv octets ${octets} ${octet};
        setexpr at ${at} + 1;
    done;
fi'

# --- From the firmware's tree: an environment may come from another board, with its numbers. ---

fdt addr ${fdtcontroladdr}
fdt get value serial# / serial-number

setenv node /scb/ethernet@7d580000
setenv property local-mac-address
run read_octets
setenv ethernet_address ${octets}

# Octets in reverse. A chip without an address of its own stays silent, so one is made of the serial
# number: 02:0d:1d and its last three octets; 02 says that it is no manufacturer's.
setenv node /soc/serial@7e201000/bluetooth
setenv property local-bd-address
run read_octets
if test -z "${octets}" || test "${octets}" = "0 0 0 0 0 0"; then
    setenv octets
    if test -n "${serial#}"; then
        setexpr one ${serial#} "&" ff
        setexpr two ${serial#} / 100
        setexpr two ${two} "&" ff
        setexpr three ${serial#} / 10000
        setexpr three ${three} "&" ff
        setenv octets ${one} ${two} ${three} 1d 0d 2
    fi
fi
setenv bluetooth_address ${octets}

# What the firmware has switched off is not there. (A loop's own variable gives way to one of the
# environment, so it has a name of its own.)
setenv absent
for device in /scb/pcie@7d500000 /scb/ethernet@7d580000 /soc/rng@7e104000 /soc/avs-monitor@7d5d2000/thermal /soc/watchdog@7e100000; do
    setenv status
    fdt get value status ${device} status
    if test "${status}" = disabled; then setenv absent ${absent} ${device}; fi
done

# --- Into the slot's tree ---

fdt addr ${fdt_addr_r}
fdt resize 1000
if test -n "${ethernet_address}"; then
    setenv ethaddr
    fdt set /scb/ethernet@7d580000 local-mac-address [${ethernet_address}]
fi
if test -n "${bluetooth_address}"; then
    fdt set /soc/serial@7e201000/bluetooth local-bd-address [${bluetooth_address}]
fi
for device in ${absent}; do
    fdt set ${device} status disabled
done

# --- odid.conf's [board] keys ---

if test "${board_antenna}" = external; then
    fdt rm /soc/firmware/gpio/ant1-hog output-high
    fdt set /soc/firmware/gpio/ant1-hog output-low
    fdt rm /soc/firmware/gpio/ant2-hog output-low
    fdt set /soc/firmware/gpio/ant2-hog output-high
fi

if test "${board_usb}" = gadget; then
    fdt set /soc/usb@7e980000 dr_mode peripheral
fi

for uart in ${board_uarts} ${board_console}; do
    setenv node
    if test ${uart} = uart1; then
        setenv node /soc/serial@7e215040
        setenv tty ttyS1
    elif test ${uart} = uart2; then
        setenv node /soc/serial@7e201400
        setenv tty ttyAMA2
    elif test ${uart} = uart3; then
        setenv node /soc/serial@7e201600
        setenv tty ttyAMA3
    elif test ${uart} = uart4; then
        setenv node /soc/serial@7e201800
        setenv tty ttyAMA4
    elif test ${uart} = uart5; then
        setenv node /soc/serial@7e201a00
        setenv tty ttyAMA5
    fi
    if test -n "${node}"; then
        fdt set ${node} status okay
        if test ${uart} = "${board_console}"; then setenv console ${tty},115200; fi
    fi
done
if test "${board_console}" = usb; then setenv console ttyGS0; fi
