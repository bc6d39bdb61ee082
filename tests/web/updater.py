"""A model of SWUpdate's control socket: takes a bundle as SWUpdate does, and installs nothing.

The messages' layout differs between SWUpdate's versions; the model knows only what is the same in all:
each begins with a magic number and a type, and an answer is as long as its question.
"""

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
        self.path.chmod(0o666)              # the appliance has a group for it
        self.listener.listen(4)
        self.busy = False                   # says no to the next request
        self.limit = None                   # closes its end after so many octets
        self.rate = None                    # octets a second
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
            with connection:
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
            piece = connection.recv(65536)
            if not piece:
                break
            bundle += piece
            self.taken = len(bundle)
            if self.rate:
                time.sleep(len(piece) / self.rate)
        self.bundles.append(bytes(bundle))
        self.over.set()

    def stop(self):
        self.listener.close()
        self.path.unlink(missing_ok=True)
