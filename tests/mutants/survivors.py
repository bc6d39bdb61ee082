"""Random changes that survive because they change nothing that anybody can see, each with its reason."""

from collections import namedtuple

# line: as it stands in the source, without its indentation.
Survivor = namedtuple("Survivor", "file line before after why")

SURVIVORS = (
    Survivor("bluetooth_commands.c", "memset(end, 0, 7); /* no peer */", "7", "8", "the eighth octet is written next"),
    Survivor("kept.c", "if (fd < 0) {", "<", "<=", "standard input is open: no file gets its number"),
    Survivor("aircraft_view.c", "out->area_count = native->known && native->area_count > 0 ? native->area_count : 1;", "0", "1",
             "one area is what stands in for none"),
    Survivor("wifi_beacon.c", ": (unsigned)((element->length - MESSAGES_ELEMENT_EMPTY) / MESSAGE_SIZE);", "-", "+",
             "twice what comes before the messages is less than one of them"),
    Survivor("alive.c", "if (self.fd < 0) {", "0", "1", "standard input is open: no socket gets its number"),
    Survivor("vertical.c", "#define WINDOW_US 1000000", "1000000", "999999", "an autopilot's clock has milliseconds"),
)


def reason(file, line, before, after):
    """None: it isn't among them, and has to be caught."""
    for one in SURVIVORS:
        if one[:4] == (file, line, before, after):
            return one.why
    return None
