"""Whether the daemon's sources keep to their rooms. Given the files of package/odid-daemon/src.

A folder is a library, which knows only libraries before it, or a program, which knows libraries and no other program: by what
its files include. And within a folder no sources call each other in a circle.
"""

import re
import sys
from pathlib import Path

LIBRARIES = ("base", "radio", "config", "mavlink", "appliance", "flights")
INCLUDE = re.compile(r'^#include "([^"]+)"', re.M)
COMMENT_OR_TEXT = re.compile(r'/\*.*?\*/|"(?:\\.|[^"\\])*"', re.S)
DEFINED = re.compile(r"^(?!static )\w[\w *]*?(\w+)\([^;{}]*\)\n\{", re.M)  # as clang-format puts it
CALLED = re.compile(r"\b(\w+)\(")


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


def calls(paths):
    """Of each source those of its folder that it calls."""
    code = {path: COMMENT_OR_TEXT.sub("", path.read_text()) for path in paths}
    owner = {(path.parent, name): path for path in paths for name in DEFINED.findall(code[path])}
    return {path: {owner.get((path.parent, name), path) for name in CALLED.findall(code[path])} - {path} for path in paths}


def circle(called, path, way=()):
    """A way from that source back to itself, by calls; empty: there is none."""
    if path in way:
        return (*way, path) if path == way[0] else ()
    return next((found for other in sorted(called[path]) if (found := circle(called, other, (*way, path)))), ())


def circles(paths):
    """A sentence for each circle, where its first source stands."""
    called = calls(paths)
    for path in paths:
        found = circle(called, path)
        if found and path == min(found):
            yield f"{path}: calls itself by {', '.join(other.name for other in found[1:-1])}"


def main():
    paths = [Path(name) for name in sys.argv[1:]]
    sentences = [sentence for path in paths for sentence in wrong(path)]
    sentences += circles([path for path in paths if path.suffix == ".c"])
    print("\n".join(sentences), end="\n" if sentences else "")
    return 1 if sentences or not paths else 0


if __name__ == "__main__":
    sys.exit(main())
