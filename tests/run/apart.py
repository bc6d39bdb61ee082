"""Whether a test module is imported by another one. Given the Python files of tests.

What two of them need is a module's that is no test: who changes a test then looks at one file, and none is run, or skipped,
because of another one's imports.
"""

import ast
import sys
from pathlib import Path


def imported(tree):
    """(line, what it may be a module's name) of everything that is imported, anywhere in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            yield from ((node.lineno, name) for name in (*(node.module or "").split("."), *(one.name for one in node.names)))
        elif isinstance(node, ast.Import):
            yield from ((node.lineno, name) for one in node.names for name in one.name.split("."))


def main():
    paths = [Path(name) for name in sys.argv[1:]]
    tests = {path.stem for path in paths if path.name.startswith("test_")}
    sentences = [f"{path}:{line}: {name} is a test module: put what both need into one that isn't"
                 for path in paths for line, name in imported(ast.parse(path.read_text(encoding="utf-8"))) if name in tests]
    print("\n".join(sentences), end="\n" if sentences else "")
    return 1 if sentences or not tests else 0


if __name__ == "__main__":
    sys.exit(main())
