"""People who look at the pages of a monitor while it works."""

import threading
import time
import urllib.request
from types import TracebackType

#: Pages that a viewer loads in turn, and the time between two of them [s].
PATHS, THINKING = ("/", "/vehicles/car", "/alerts", "/vehicles/car/windows"), 2.0


class Viewers:
    """Viewers with live events, each of whom loads a page every two seconds; in threads of this process.

    Parameters
    ----------
    address
        Address of the pages, such as "http://127.0.0.1:8737".
    number
        Number of viewers.
    """

    def __init__(self, address: str, number: int) -> None:
        self._address, self._stopping = address, threading.Event()
        #: Times of pages [s], and requests that failed.
        self.times: list[float] = []
        self.n_failed = 0
        acts = [act for _ in range(number) for act in (self._load, self._listen)]
        self._threads = [threading.Thread(target=act, args=(k,), daemon=True) for k, act in enumerate(acts)]

    def __enter__(self) -> "Viewers":
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stopping.set()

    def _load(self, number: int) -> None:
        while not self._stopping.wait(THINKING):
            number += 1
            begin = time.perf_counter()
            request = urllib.request.Request(
                self._address + PATHS[number % len(PATHS)], headers={"Accept": "text/html"}
            )
            try:
                with urllib.request.urlopen(request, timeout=60) as answer:
                    answer.read()
            except OSError:
                self.n_failed += 1
            else:
                self.times.append(time.perf_counter() - begin)

    def _listen(self, _number: int) -> None:
        while not self._stopping.is_set():
            try:
                with urllib.request.urlopen(f"{self._address}/api/v1/events", timeout=60) as events:
                    while not self._stopping.is_set() and events.readline():
                        pass
            except OSError:
                self._stopping.wait(THINKING)
