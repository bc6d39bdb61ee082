"""Flights for the bench: generated, moving from the fourth second on, and what an autopilot's restart
makes of one."""

import os
import struct

from models import tlog
from models.flight import write_flight

os.environ.setdefault("MAVLINK20", "1")
WITH_BOOT_TIME = ("GLOBAL_POSITION_INT", "SYSTEM_TIME")


def generate(path, seconds):
    """Positions at 5 Hz, as an autopilot sends that was asked for them."""
    write_flight(path, seconds)
    return path


def restarted(source, path, at_s, boot_s=2.0):
    """The same flight, of an autopilot that had been up for boot_s at second at_s: place and time of
    day go on, its own clock does not."""
    frames = tlog.read(source)
    first_s, decoder, link = frames[0][0], tlog.Decoder(), tlog.mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    shift_ms = None
    with open(path, "wb") as out:
        for time_s, frame in frames:
            for message in decoder.messages(frame):
                if message.get_type() in WITH_BOOT_TIME and time_s - first_s >= at_s:
                    if shift_ms is None:
                        shift_ms = message.time_boot_ms - round(boot_s * 1000)
                    message.time_boot_ms -= shift_ms
                    link.seq = message.get_seq()
                    frame = message.pack(link)
            out.write(struct.pack(">Q", round(time_s * 1e6)) + frame)
    return path
