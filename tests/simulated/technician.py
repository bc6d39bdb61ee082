"""A technician who asks the daemon each second how it is, as odidctl does."""

import json
import socket

EVERY_US = 1_000_000


class Technician:
    """answers: the daemon's status (JSON), each time it was there to say; and on_answer is told of it."""

    def __init__(self, world, path, first_us, on_answer):
        self.world, self.path, self.answers, self.on_answer = world, path, [], on_answer
        world.at(first_us, self._ask)

    def _ask(self):
        self.world.after(EVERY_US, self._ask)
        sock, octets = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM), []
        sock.setblocking(False)
        try:
            sock.connect(str(self.path))
        except (FileNotFoundError, ConnectionRefusedError, BlockingIOError):
            sock.close()  # nobody is there, or it hangs
            return
        self.world.listen(sock, lambda: self._read(sock, octets))
        self.world.tell(sock, b"")

    def _read(self, sock, octets):
        while True:
            try:
                some = sock.recv(65536)
            except BlockingIOError:
                return
            except ConnectionError:
                some = b""
            if not some:
                break
            octets.append(some)
        self.world.close(sock)
        if octets:  # else it ended before it answered
            self.answers.append(json.loads(b"".join(octets)))
            self.on_answer(self.answers[-1])
