"""Figures of the running monitor for Prometheus, its health, and its alerts, by HTTP."""

import json
import re
import threading
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from sprung.errors import ParameterError

#: Name, kind and meaning of every figure.
FIGURES = {
    "sprung_vehicles": ("gauge", "Vehicles known."),
    "sprung_frames_total": ("counter", "Frames received and stored; duplicates count."),
    "sprung_messages_total": ("counter", "Messages received."),
    "sprung_messages_refused_total": ("counter", "Messages that are not valid in this version."),
    "sprung_frames_lost_total": ("counter", "Frames that boxes had to drop."),
    "sprung_windows_total": ("counter", "Windows analysed."),
    "sprung_identifications_total": ("counter", "Identifications of modes."),
    "sprung_identifications_thinned_total": (
        "counter",
        "Identifications left out while the analysis was behind.",
    ),
    "sprung_identifications_thinned_ratio": ("gauge", "Share of the identifications left out."),
    "sprung_failures_total": ("counter", "Jobs of workers that failed."),
    "sprung_alerts_active": ("gauge", "Active alerts."),
    "sprung_backlog_frames": ("gauge", "Frames stored and not yet analysed."),
    "sprung_backlog_age_seconds": ("gauge", "Age of the oldest frame that waits to be analysed."),
    "sprung_boxes_free_bytes": ("gauge", "Free disk space of the box that has the least."),
    "sprung_link_connected": ("gauge", "1 while connected to the broker."),
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
    """Answers /metrics, /health and /alerts/NUMBER.

    Parameters
    ----------
    address
        Host and port; port 0: any free one.
    figures
        Function that returns those of `FIGURES`.
    troubles
        Function that returns a sentence about each trouble.
    alert
        Function that returns the text about the alert of a number; None if there is none.
    """

    def __init__(
        self,
        address: tuple[str, int],
        *,
        figures: Callable[[], Mapping[str, float]],
        troubles: Callable[[], list[str]],
        alert: Callable[[int], str | None] = lambda number: None,
    ) -> None:
        self._address, self._figures, self._troubles, self._alert = address, figures, troubles, alert
        self._server: ThreadingHTTPServer | None = None
        self._thread: threading.Thread | None = None

    @property
    def is_open(self) -> bool:
        """Whether the server is open."""
        return self._server is not None

    @property
    def port(self) -> int | None:
        """Port of the server; None before it is opened."""
        return None if self._server is None else int(self._server.server_address[1])

    def open(self) -> None:
        """Start answering.

        Raises
        ------
        ParameterError
            If the address cannot be used.
        """
        host, port = self._address
        try:
            self._server = ThreadingHTTPServer(self._address, self._handler())
        except OSError as error:
            raise ParameterError(f"cannot listen at {host}:{port} ({error.strerror}): give another --http") from None
        self._thread = threading.Thread(target=self._server.serve_forever, name="http", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop."""
        if self._server is not None and self._thread is not None:
            self._server.shutdown()
            self._thread.join(5.0)
            self._server.server_close()
            self._server = self._thread = None

    def _answer(self, path: str) -> tuple[int, str, str]:
        """Return status, content type and text for a path."""
        if path == "/metrics":
            return 200, "text/plain; version=0.0.4", exposition(self._figures())
        if path == "/health":
            troubles = self._troubles()
            document = {"healthy": not troubles, "troubles": troubles}
            return 503 if troubles else 200, "application/json", json.dumps(document)
        number = re.fullmatch(r"/alerts/(\d{1,18})", path)
        text = None if number is None else self._alert(int(number[1]))
        if text is not None:
            return 200, "text/plain; charset=utf-8", text
        return 404, "text/plain", "not found: /metrics, /health and /alerts/NUMBER are served\n"

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        """Return the class that handles requests."""
        answer = self._answer

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
                """Log no requests."""

        return Handler
