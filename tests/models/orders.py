"""Orders on standard input, one a line, each answered by "done" or "error: ..."."""

import os
import sys


class Orders:
    def __init__(self, obey):
        """obey: called with the words of each order; a ValueError is the error that is answered."""
        self.obey, self.rest = obey, b""

    def take(self):
        """Reads what is there and obeys it. Returns whether more may come."""
        data = os.read(sys.stdin.fileno(), 4096)
        *lines, self.rest = (self.rest + data).split(b"\n")
        for line in lines:
            try:
                self.obey(line.decode().split())
            except ValueError as error:
                print(f"error: {error}", flush=True)
            else:
                print("done", flush=True)
        return bool(data)
