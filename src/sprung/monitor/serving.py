"""Figures of the running monitor for Prometheus, its health, and its alerts, by HTTP."""

import json
import queue
import re
import threading
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TypeVar

from sprung.errors import ParameterError, SprungError

T = TypeVar("T")

#: Longest time for an answer of the store [s], and largest number of requests that wait for one.
_PATIENCE, _MOST_ASKING = 2.0, 4
#: Longest time between the bytes of a request [s].
_SLOWEST = 10.0

#: Name, kind and meaning of every figure.
FIGURES = {
    "sprung_vehicles": ("gauge", "Vehicles known."),
    "sprung_frames_total": ("counter", "Frames received and stored; duplicates count."),
    "sprung_messages_total": ("counter", "Messages received."),
    "sprung_message_age_seconds": ("gauge", "Time since the last message arrived."),
    "sprung_messages_refused_total": ("counter", "Messages refused, for any reason."),
    "sprung_refusals_total": ("counter", "Messages refused, by vehicle and reason."),
    "sprung_queue_bytes": ("gauge", "Bytes of messages that wait for intake."),
    "sprung_frames_lost_total": ("counter", "Frames that boxes had to drop."),
    "sprung_vehicle_frames_lost_total": ("counter", "Frames that the box of a vehicle had to drop."),
    "sprung_windows_total": ("counter", "Windows analysed."),
    "sprung_window_age_seconds": ("gauge", "Time since the last window was analysed."),
    "sprung_identifications_total": ("counter", "Identifications of modes."),
    "sprung_identifications_thinned_total": (
        "counter",
        "Identifications left out while the analysis was behind.",
    ),
    "sprung_identifications_thinned_ratio": ("gauge", "Share of the identifications left out."),
    "sprung_failures_total": ("counter", "Jobs of workers that failed."),
    "sprung_frames_set_aside_total": ("counter", "Frames whose analysis failed repeatedly, or needs too much memory."),
    "sprung_states_set_aside_total": ("counter", "Saved states that could not be used."),
    "sprung_vehicles_waiting": ("gauge", "Vehicles that could not be opened and are tried again after a while."),
    "sprung_vehicles_slow": ("gauge", "Vehicles that share the process for slow ones."),
    "sprung_workers_replaced_total": ("counter", "Processes that died or took too long."),
    "sprung_alerts_active": ("gauge", "Active alerts."),
    "sprung_notifications_sent_total": ("counter", "Notifications passed on, counted by each sender."),
    "sprung_notifications_given_up_total": ("counter", "Notifications given up, counted by each sender."),
    "sprung_backlog_frames": ("gauge", "Frames stored and not yet analysed."),
    "sprung_backlog_age_seconds": ("gauge", "Age of the oldest frame that waits to be analysed."),
    "sprung_boxes_free_bytes": ("gauge", "Free disk space of the box that has the least."),
    "sprung_link_connected": ("gauge", "1 while connected to the broker."),
    "sprung_monitors": ("gauge", "Monitors that share the store."),
    "sprung_shards": ("gauge", "Shards of vehicles that this monitor works for, of 256."),
    "sprung_store_bytes": ("gauge", "Size of the store."),
    "sprung_store_writable": ("gauge", "1 while the store can be written."),
    "sprung_heartbeat_age_seconds": ("gauge", "Time since each loop of the monitor last turned."),
}


def labelled(name: str, **labels: str) -> str:
    """Return the name of a figure with labels, whose values have neither quotes, backslashes nor line ends."""
    return name + "{" + ",".join(f'{label}="{value}"' for label, value in labels.items()) + "}"


def exposition(figures: Mapping[str, float]) -> str:
    """Return figures in the text format of Prometheus; a name may be followed by labels in braces."""
    of_names: dict[str, list[str]] = {name: [] for name in FIGURES}
    for name, value in figures.items():
        of_names[name.partition("{")[0]].append(f"{name} {value:.10g}")
    lines = []
    for name, samples in of_names.items():
        kind, meaning = FIGURES[name]
        if samples:
            lines += [f"# HELP {name} {meaning}", f"# TYPE {name} {kind}", *samples]
    return "\n".join(lines) + "\n"


class Serving:
    """Answers /metrics, /health and /alerts/NUMBER.

    Parameters
    ----------
    address
        Host and port; port 0: any free one.
    figures
        Function that returns those of `FIGURES` that need no store.
    troubles
        Function that returns a sentence about each trouble; it needs no store.
    stored
        Function that returns the figures of the store.
    alert
        Function that returns the text about the alert of a number, from the store; None if there is none.
    patience
        Longest time for an answer of the store [s].

    Notes
    -----
    What needs the store is asked in a thread of its own, and left out if it fails or takes too long.
    """

    def __init__(
        self,
        address: tuple[str, int],
        *,
        figures: Callable[[], Mapping[str, float]],
        troubles: Callable[[], list[str]],
        stored: Callable[[], Mapping[str, float]] = dict,
        alert: Callable[[int], str | None] = lambda number: None,
        patience: float = _PATIENCE,
    ) -> None:
        self._address, self._figures, self._troubles = address, figures, troubles
        self._stored, self._alert, self._patience = stored, alert, patience
        self._asking = threading.Semaphore(_MOST_ASKING)
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
            stored = self._within_patience(self._stored)
            figures = {**self._figures(), **({"sprung_store_writable": 0.0} if stored is None else stored)}
            return 200, "text/plain; version=0.0.4; charset=utf-8", exposition(figures)
        if path == "/health":
            troubles = self._troubles()
            document = {"healthy": not troubles, "troubles": troubles}
            return 503 if troubles else 200, "application/json", json.dumps(document)
        number = re.fullmatch(r"/alerts/(\d{1,18})", path)
        if number is not None:
            answer = self._within_patience(lambda: (self._alert(int(number[1])),))
            if answer is None:
                return 503, "text/plain", "the store does not answer: try again later, and look at /health\n"
            if answer[0] is not None:
                return 200, "text/plain; charset=utf-8", answer[0]
        return 404, "text/plain", "not found: /metrics, /health and /alerts/NUMBER are served\n"

    def _within_patience(self, act: Callable[[], T]) -> T | None:
        """Return what a function of the store returns; None if it fails, takes too long, or many others do."""
        if not self._asking.acquire(blocking=False):
            return None
        answers: queue.SimpleQueue[T | None] = queue.SimpleQueue()

        def ask() -> None:
            try:
                answers.put(act())
            except (SprungError, OSError):
                answers.put(None)
            finally:
                self._asking.release()

        threading.Thread(target=ask, name="http store", daemon=True).start()
        try:
            return answers.get(timeout=self._patience)
        except queue.Empty:
            return None

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        """Return the class that handles requests."""
        answer = self._answer

        class Handler(BaseHTTPRequestHandler):
            timeout = _SLOWEST

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
