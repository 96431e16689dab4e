"""Figures of the running monitor for Prometheus, and whether it is well, by HTTP."""

import json
import threading
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from sprung.errors import ParameterError

#: Name, kind and meaning of every figure.
FIGURES = {
    "sprung_vehicles": ("gauge", "Vehicles known."),
    "sprung_frames_total": ("counter", "Frames received and stored; one that comes twice counts twice."),
    "sprung_messages_total": ("counter", "Messages received."),
    "sprung_messages_refused_total": ("counter", "Messages that were no frames of this version."),
    "sprung_frames_lost_total": ("counter", "Frames that boxes could not keep."),
    "sprung_windows_total": ("counter", "Windows worked up."),
    "sprung_identifications_total": ("counter", "Identifications of modes."),
    "sprung_failures_total": ("counter", "Jobs of workers that failed."),
    "sprung_alerts_active": ("gauge", "Active alerts."),
    "sprung_backlog_frames": ("gauge", "Frames stored and not yet worked up."),
    "sprung_boxes_free_bytes": ("gauge", "Room on the disk of the box that has the least."),
    "sprung_link_connected": ("gauge", "1 while the broker is connected."),
    "sprung_store_bytes": ("gauge", "Size of the store."),
    "sprung_store_writable": ("gauge", "1 while the store can be written."),
}


def exposition(figures: Mapping[str, float]) -> str:
    """Return figures in the text format of Prometheus."""
    lines = []
    for name, (kind, meaning) in FIGURES.items():
        if name in figures:
            lines += [f"# HELP {name} {meaning}", f"# TYPE {name} {kind}", f"{name} {figures[name]:.10g}"]
    return "\n".join(lines) + "\n"


class Serving:
    """Answers /metrics and /health.

    Parameters
    ----------
    address
        Host and port.
    figures
        Returns those of `FIGURES`.
    troubles
        Returns sentences; none where all is well.
    """

    def __init__(
        self,
        address: tuple[str, int],
        *,
        figures: Callable[[], Mapping[str, float]],
        troubles: Callable[[], list[str]],
    ) -> None:
        def answer(path: str) -> tuple[int, str, str]:
            if path == "/metrics":
                return 200, "text/plain; version=0.0.4", exposition(figures())
            if path == "/health":
                found = troubles()
                return (
                    (503 if found else 200),
                    "application/json",
                    json.dumps({"healthy": not found, "troubles": found}),
                )
            return 404, "text/plain", "ask for /metrics or /health\n"

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                status, kind, text = answer(self.path.split("?")[0])
                body = text.encode()
                self.send_response(status)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_: object) -> None:
                """Leave the log to what matters."""

        try:
            self._server = ThreadingHTTPServer(address, Handler)
        except OSError as error:
            raise ParameterError(
                f"nothing can be served at {address[0]}:{address[1]}: {error.strerror}: give another --http"
            ) from None
        self._thread = threading.Thread(target=self._server.serve_forever, name="http", daemon=True)

    @property
    def port(self) -> int:
        """At which it answers."""
        return int(self._server.server_address[1])

    def open(self) -> None:
        """Begin to answer."""
        self._thread.start()

    def close(self) -> None:
        """Stop."""
        if self._thread.is_alive():
            self._server.shutdown()
            self._thread.join(5.0)
        self._server.server_close()
