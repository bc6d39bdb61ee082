"""A web server with the bundles, which the machine reaches as 10.0.2.2. A path of the form
/RATE/NAME gives NAME at so many octets a second; `stop` breaks all of them off."""

import http.server
import ssl
import threading
import time
from pathlib import Path

GUEST_SEES = "10.0.2.2"
PIECES_S = 20


def serve(handler, tls=None):
    """A web server in the background, and where the machine reaches it. tls: (certificate, key), files."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    server.daemon_threads = True
    if tls:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(*tls)
        # Not while it accepts: one device that doesn't go on must not keep the others waiting.
        server.socket = context.wrap_socket(server.socket, server_side=True, do_handshake_on_connect=False)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server, f"{'https' if tls else 'http'}://{GUEST_SEES}:{server.server_address[1]}"


def paced(data, rate=None):
    """Its pieces, at so many octets a second if there is a rate."""
    piece = max(1, rate // PIECES_S) if rate else 1 << 20
    for at in range(0, len(data), piece):
        yield data[at:at + piece]
        if rate:
            time.sleep(1 / PIECES_S)


class Server:
    def __init__(self, folder, tls=None):
        self.folder, self._stopped = Path(folder), threading.Event()
        outer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):       # noqa: N802, the library's name
                rate, _, name = self.path.strip("/").rpartition("/")
                file = outer.folder / name
                if not file.is_file():
                    self.send_error(404)
                    return
                self.send_response(200)
                self.send_header("Content-Length", str(file.stat().st_size))
                self.end_headers()
                try:
                    outer.send(file, int(rate) if rate else None, self.wfile)
                except OSError:
                    pass            # it had enough

            def log_message(self, *_):
                pass

        self._server, self._url = serve(Handler, tls)

    def send(self, file, rate, out):
        for piece in paced(file.read_bytes(), rate):
            if self._stopped.is_set():
                return
            out.write(piece)

    def url(self, file, rate=None):
        return f"{self._url}/{f'{rate}/' if rate else ''}{Path(file).name}"

    def stop(self):
        self._stopped.set()
        self._server.shutdown()
        self._server.server_close()
