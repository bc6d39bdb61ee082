"""What the appliance has to keep, out of the emulated machine: the figures of the bar."""

# Seconds; 50 ms of each are allowed to the emulation.
AIR_S = {f"{channel}_location_content_{name}_s": limit_s
         for channel in ("bt4", "wifi") for name, limit_s in (("p99", 0.35), ("max", 0.5))}
# From init to the first valid message.
BOOT_S = {"bt4": 4.0, "wifi": 5.0}


def arguments(kind=""):
    """The judge's, of all or of those of one kind ("p99")."""
    return [word for name, limit_s in AIR_S.items() if kind in name for word in ("--limit", f"{name}={limit_s}")]
