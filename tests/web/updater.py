"""A model of SWUpdate's control socket: takes a bundle as SWUpdate does, and installs nothing.

The messages' layout differs between SWUpdate's versions; the model knows only what is the same in all:
each begins with a magic number and a type, and an answer is as long as its question.
"""

import contextlib
import socket
import struct
import threading
import time

MAGIC = 0x14052001
REQUEST_INSTALL, ACK, NACK = 0, 1, 2


class Updater:
    def __init__(self, folder):
        self.path = folder / "sockinstctrl"
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(str(self.path))
        self.path.chmod(0o600)              # root's, as on the appliance: the half that speaks HTTP can't reach it
        self.listener.listen(4)
        self.busy = False                   # says no to the next request
        self.limit = None                   # closes its end after so many octets
        self.rate = None                    # octets a second
        self.stops_at = None                # after so many octets takes no more, until `goes_on` is set
        self.goes_on = threading.Event()
        self.says = None                    # called before it closes its end: a result is known by then
        self.bundles = []                   # the octets of each that has ended
        self.taken = 0                      # of the one under way
        self.over = threading.Event()
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            with connection, contextlib.suppress(ConnectionError):      # who asked may be gone before the answer
                self._install(connection)

    def _install(self, connection):
        question = connection.recv(65536)
        magic, kind = struct.unpack_from("ii", question)
        assert (magic, kind) == (MAGIC, REQUEST_INSTALL), question[:16]
        answer = struct.pack("ii", MAGIC, NACK if self.busy else ACK)
        connection.sendall(answer.ljust(len(question), b"\0"))
        if self.busy:
            return
        bundle, self.taken = bytearray(), 0
        while self.limit is None or self.taken < self.limit:
            if self.stops_at is not None and self.taken >= self.stops_at:
                self.goes_on.wait()
            piece = connection.recv(65536)
            if not piece:
                break
            bundle += piece
            self.taken = len(bundle)
            rate = self.rate                # a test may change it at any time
            if rate:
                time.sleep(len(piece) / rate)
        if self.says:
            self.says()
        self.bundles.append(bytes(bundle))
        self.over.set()

    def stop(self):
        self.goes_on.set()
        self.listener.close()
        self.path.unlink(missing_ok=True)
