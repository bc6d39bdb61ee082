"""An autopilot on the ground, armed or not, for as long as a test wants."""

import struct

from bench import flights
from models import flight, tlog

SAFETY_ARMED = tlog.mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def generate(folder, armed, seconds=300, unix_s=flight.START_UNIX_S):
    """A log in which it is armed, or not, from its first second on; unix_s: its GNSS time then."""
    source = flights.generate(folder / "flight.tlog", seconds)
    path = folder / f"{'armed' if armed else 'disarmed'}.tlog"
    decoder, link = tlog.Decoder(), tlog.mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    with open(path, "wb") as out:
        for time_s, frame in tlog.read(source):
            for message in decoder.messages(frame):
                if message.get_type() == "HEARTBEAT":
                    link.seq = message.get_seq()
                    message.base_mode = message.base_mode & ~SAFETY_ARMED | (SAFETY_ARMED if armed else 0)
                    frame = message.pack(link)
                elif message.get_type() == "SYSTEM_TIME":
                    link.seq = message.get_seq()
                    message.time_unix_usec += round((unix_s - flight.START_UNIX_S) * 1e6)
                    frame = message.pack(link)
            out.write(struct.pack(">Q", round(time_s * 1e6)) + frame)
    return path
