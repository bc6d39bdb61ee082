"""build/image/figures.json: what is measured of the release images."""

import json
import time

from .conftest import TOP, call


def figures(board, **values):
    """Added to build/image/figures.json."""
    path = TOP / "build/image/figures.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    known = json.loads(path.read_text()) if path.exists() else {}
    known.update({f"{board}_{name}": value for name, value in values.items()})
    known["commit"] = call("git", "-C", TOP, "rev-parse", "HEAD").strip()
    known["date"] = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    path.write_text(json.dumps(known, indent=1) + "\n")
