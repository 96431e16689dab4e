"""Diagrams of windows from archived samples: one at a time, in a process of their own, and the last ones kept."""

import json
import os
import subprocess
import sys
import threading
from collections import OrderedDict
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any

from sprung.errors import SprungError
from sprung.online.site.busy import BusyError

#: Longest time that the diagrams of a window may take [s], and largest answer [bytes].
_LIMIT, _MOST_BYTES = 180.0, 1 << 26
#: Time after which diagrams that are being computed may be asked for again [s].
RETRY = 5
#: Number of windows whose diagrams are kept: at most about 2 MB each.
_MOST_KEPT = 8


@dataclass(frozen=True, eq=False, slots=True)
class Computed:
    """Diagrams of a window, or why there are none.

    Parameters
    ----------
    values
        Values as `sprung.online.monitor.diagrams.diagram_values` gives them; empty without diagrams.
    pictures
        Figures as SVG, by name.
    error
        Reason why there are none; empty otherwise.
    """

    values: Mapping[str, Any] = field(default_factory=dict)
    pictures: Mapping[str, str] = field(default_factory=dict)
    error: str = ""


class DiagramDesk:
    """Computes the diagrams of windows, one at a time, and keeps the last ones.

    Parameters
    ----------
    command
        Program that reads a request and writes the answer, as `sprung.online.monitor.diagrams` does.
    limit
        Longest time that it may take [s].

    Notes
    -----
    No request waits: the first one starts the computation, and a later one finds its result.
    """

    def __init__(
        self,
        *,
        command: tuple[str, ...] = (sys.executable, "-P", "-m", "sprung.online.monitor.diagrams"),
        limit: float = _LIMIT,
    ) -> None:
        self._command, self._limit = command, limit
        self._lock = threading.Lock()
        self._kept: OrderedDict[str, Computed] = OrderedDict()
        self._present = ""
        self._process: subprocess.Popen[bytes] | None = None
        self._is_closed = False

    def take(self, request: Mapping[str, Any], *, again: bool = False) -> Computed:
        """Return diagrams, or begin to compute them.

        Parameters
        ----------
        request
            Request as `sprung.online.monitor.diagrams.answer` takes it.
        again
            Whether diagrams that could not be computed are tried again.

        Raises
        ------
        BusyError
            If they, or those of another window, are being computed.
        """
        text = json.dumps(request, sort_keys=True)
        key = sha256(text.encode()).hexdigest()
        with self._lock:
            if again and key in self._kept and self._kept[key].error:
                del self._kept[key]
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
            if self._present and self._present != key:
                raise BusyError(f"diagrams of another window are being computed: try again in {RETRY} s")
            if not self._present and not self._is_closed:
                self._present = key
                threading.Thread(target=self._run, args=(key, text), name="diagrams", daemon=True).start()
        raise BusyError(f"the diagrams are being computed from the samples: try again in {RETRY} s")

    def close(self) -> None:
        """End what is under way, and begin nothing more."""
        with self._lock:
            self._is_closed = True
            if self._process is not None:
                self._process.kill()

    def _run(self, key: str, text: str) -> None:
        """Compute, and keep the result."""
        computed = Computed(error="their process failed")
        try:
            computed = self._computed(text)
        finally:
            with self._lock:
                self._kept[key] = computed
                while len(self._kept) > _MOST_KEPT:
                    self._kept.popitem(last=False)
                self._present, self._process = "", None

    def _computed(self, text: str) -> Computed:
        """Return the answer of a separate process."""
        with self._lock:
            if self._is_closed:
                return Computed(error="the server is stopping")
            self._process = process = subprocess.Popen(
                self._command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"},
            )
        try:
            output, _ = process.communicate(text.encode(), timeout=self._limit)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            return Computed(error=f"they took longer than {self._limit:g} s")
        with suppress(ValueError, KeyError, TypeError):
            answer = json.loads(output) if len(output) <= _MOST_BYTES else {}
            return Computed(error=answer["error"]) if "error" in answer else Computed(**answer)
        return Computed(error=f"their process failed (exit code {process.returncode})")


class NoSamplesError(SprungError):
    """A window whose samples are not kept, or show nothing."""
