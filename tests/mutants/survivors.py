"""Random changes that survive because they change nothing that anybody can see, each with its reason."""

from collections import namedtuple

# line: as it stands in the source, without its indentation.
Survivor = namedtuple("Survivor", "file line before after why")

SURVIVORS = ()


def reason(file, line, before, after):
    """None: it isn't among them, and has to be caught."""
    for one in SURVIVORS:
        if one[:4] == (file, line, before, after):
            return one.why
    return None
