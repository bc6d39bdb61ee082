"""Whether the daemon's sources keep to their rooms, by what they include. Given the files of package/odid-daemon/src.

A folder is a library, which knows only libraries before it, or a program, which knows libraries and no other program.
"""

import re
import sys
from pathlib import Path

LIBRARIES = ("base", "radio", "config", "mavlink", "appliance", "flights")
INCLUDE = re.compile(r'^#include "([^"]+)"', re.M)


def rank(room):
    """Programs come after all libraries."""
    return LIBRARIES.index(room) if room in LIBRARIES else len(LIBRARIES)


def wrong(path):
    """A sentence for each include of that file that isn't allowed."""
    room = path.parent.name
    for named in INCLUDE.findall(path.read_text()):
        other, slash, _ = named.partition("/")
        if not slash:
            yield f'{path}: "{named}": expected "FOLDER/{named}"'
        elif other != room and rank(other) >= rank(room):
            yield f'{path}: "{named}": {room} may not know {other}'


def main():
    sentences = [sentence for name in sys.argv[1:] for sentence in wrong(Path(name))]
    print("\n".join(sentences), end="\n" if sentences else "")
    return 1 if sentences or len(sys.argv) == 1 else 0


if __name__ == "__main__":
    sys.exit(main())
