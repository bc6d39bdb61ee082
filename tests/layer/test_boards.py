"""What a board's kernel and its first volume have to have, by what the board is for."""

import re

import pytest

from .shared import BOARDS, OVERLAY, options, read

# What scripts want of the kernel without naming a program for it.
KERNEL = {"lib/odid/update-stick": "USB_STORAGE BLK_DEV_SD VFAT_FS EXFAT_FS EXT4_FS", "etc/nftables.conf": "NF_TABLES_INET NFT_CT",
          "etc/sv/odid-web/run": "SYN_COOKIES",
          "etc/init.d/S01mounts": "CGROUPS MEMCG LRU_GEN TMPFS UNIX98_PTYS", "lib/odid/limited": "CFS_BANDWIDTH CGROUP_PIDS MEMCG"}


@pytest.mark.parametrize("script", KERNEL)
def test_the_kernel_has_what_scripts_want(script):
    assert (OVERLAY / script).exists()
    on = {name.removeprefix("CONFIG_") for name, value in options(read("board/common/linux.fragment")) if value in ("y", "m")}
    assert set(KERNEL[script].split()) <= on


# What a board must have by what it is for; a driver that is missing fails on a real board only.
DRIVERS = {
    "autopilots": "USB_ACM USB_SERIAL_CH341 USB_SERIAL_CP210X USB_SERIAL_FTDI_SIO USB_SERIAL_PL2303",
    "wired networks on USB": "USB_RTL8152 USB_LAN78XX USB_NET_AX8817X USB_NET_AX88179_178A USB_NET_CDCETHER USB_NET_CDC_NCM "
                             "USB_NET_CDC_MBIM USB_NET_QMI_WWAN USB_NET_RNDIS_HOST USB_NET_SMSC95XX",
    "the filter": "NF_TABLES_INET NF_CONNTRACK NFT_CT NFT_LIMIT",
    "hardening": "SECCOMP STACKPROTECTOR_STRONG FORTIFY_SOURCE HARDENED_USERCOPY SLAB_FREELIST_HARDENED INIT_ON_ALLOC_DEFAULT_ON "
                 "INIT_STACK_ALL_ZERO VMAP_STACK RANDOMIZE_BASE UNMAP_KERNEL_AT_EL0 STRICT_KERNEL_RWX STRICT_MODULE_RWX "
                 "SECURITY_DMESG_RESTRICT",
}
CM4_DRIVERS = {
    "radios": "BRCMFMAC BRCMFMAC_SDIO BT_HCIUART_SERDEV BT_HCIUART_BCM BT_HCIBTUSB SERIAL_DEV_BUS",
    "its USB in both roles, and on PCIe": "USB_DWC2 USB_DWC2_DUAL_ROLE USB_CONFIGFS USB_CONFIGFS_NCM USB_CONFIGFS_ACM PCIE_BRCMSTB "
                                          "USB_XHCI_HCD USB_XHCI_PCI",
    "card and network": "MMC_SDHCI_IPROC MMC_BCM2835 BCMGENET",
    "memory its devices reach": "ZONE_DMA ZONE_DMA32",
    "watchdog and sensors": "BCM2835_WDT SENSORS_RASPBERRYPI_HWMON BCM2711_THERMAL",
    "clocks, power and pins of the firmware": "RASPBERRYPI_FIRMWARE CLK_BCM2835 CLK_RASPBERRYPI RASPBERRYPI_POWER GPIO_RASPBERRYPI_EXP "
                                              "RESET_RASPBERRYPI",
}


def test_a_boot_that_hangs_is_a_restart():
    """Without a limit the kernel would feed the boot loader's watchdog for an init that never gets anywhere."""
    limits = dict(options(read("board/common/linux.fragment")))
    assert limits["CONFIG_WATCHDOG_HANDLE_BOOT_ENABLED"] == "y"
    assert 0 < int(limits.get("CONFIG_WATCHDOG_OPEN_TIMEOUT", 0)) <= 60


@pytest.mark.parametrize("board, what", [(board, what) for board in BOARDS for what in DRIVERS] + [("cm4", what) for what in CM4_DRIVERS])
def test_the_kernel_has_what_the_board_is_for(board, what):
    fragments = read("board/common/linux.fragment") + read(f"board/{board}/linux.fragment")
    on = {name.removeprefix("CONFIG_") for name, value in options(fragments) if value in ("y", "m")}
    assert not set((DRIVERS | CM4_DRIVERS)[what].split()) - on


def test_the_first_volume_holds_what_the_boot_rom_and_its_settings_name():
    settings = dict(re.findall(r"^(\w+)=(.*)$", read("board/cm4/config.txt"), re.M))
    files = {line.rpartition("/")[2] for line in read("board/cm4/boot-files").splitlines() if line and not line.startswith("#")}
    # With the smallest share for the screen the boot ROM takes the firmware without one.
    kind = "4cd" if settings.get("gpu_mem") == "16" else "4"
    assert {settings["kernel"], settings["device_tree"], f"start{kind}.elf", f"fixup{kind}.dat"} <= files
