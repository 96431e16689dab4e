"""Diagrams of a window from its archived samples: spectra with fit, stabilisation diagram and subsets by level.

They are computed on demand, one window at a time, in a process of their own; the last ones are kept.
"""

import gzip
import json
import os
import subprocess
import sys
import threading
from collections import Counter, OrderedDict
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from fastapi import APIRouter, HTTPException, Request, Response
from fastapi.responses import RedirectResponse
from pydantic import Field

from sprung.errors import ParameterError
from sprung.link.archive import archive_path
from sprung.online.monitor.histories import reference_of
from sprung.online.site.accounts import Viewer
from sprung.online.site.rendering import path_of, vehicle_page
from sprung.online.site.shared import (
    LIMITS,
    Answer,
    Context,
    KnownVehicle,
    KnownWindow,
    Shared,
    context_of,
    require_vehicle,
)
from sprung.online.site.vehicles.windows import window
from sprung.online.store import Entry
from sprung.results.documents.document import Pair
from sprung.results.tables.wording import format_time

api = APIRouter(tags=["vehicles"])
pages = APIRouter(include_in_schema=False)

Figure = Literal["spectra", "fit", "stabilisation", "levels"]


class BusyError(HTTPException):
    """Diagrams that are being computed, or wait for those of another window."""

    def __init__(self, sentence: str) -> None:
        super().__init__(503, f"{sentence}: try again in {LIMITS.retry} s", headers={"retry-after": str(LIMITS.retry)})


class NoSamplesError(HTTPException):
    """A window whose samples are not kept, or show nothing."""

    def __init__(self, sentence: str) -> None:
        super().__init__(404, sentence)


class ChannelSpectrum(Answer):
    """Power spectral density of a channel."""

    channel: str
    unit: str = Field(description="unit of the samples; the density is in its square per Hz")
    density: tuple[float | None, ...]
    edited: tuple[float | None, ...] | None = Field(description="after cepstrum editing; null without it")


class WindowSpectra(Answer):
    """Power spectral densities of the channels."""

    frequencies: tuple[float, ...]
    segment_length: float = Field(description="length of the averaged segments [s]")
    n_segments: int
    channels: tuple[ChannelSpectrum, ...]


class FittedSpectrum(Answer):
    """Measured and fitted power spectral density of a coordinate."""

    coordinate: str
    unit: str
    measured: tuple[float | None, ...]
    fitted: tuple[float | None, ...]
    misfit: tuple[float | None, ...] = Field(description="measured over fitted less 1, averaged over speed classes")


class SpectraFit(Answer):
    """Fit of the vehicle to the spectra."""

    frequencies: tuple[float, ...]
    n_segments: int
    model_error: float = Field(description="RMS of the misfit in excess of chance")
    coordinates: tuple[FittedSpectrum, ...]


class PoleSet(Answer):
    """Poles of a stabilisation diagram."""

    natural_frequency: tuple[float | None, ...]
    damping_ratio: tuple[float | None, ...]
    rung: tuple[int, ...]
    status: tuple[str, ...]


class Stabilisation(Answer):
    """Stabilisation diagrams: one for each subset of segments and split of the channels."""

    rung: str = Field(description="meaning of a rung")
    band: Pair
    poles: tuple[PoleSet, ...]
    statuses: dict[str, str] = Field(description="each status in words")


class WindowDiagrams(Answer):
    """Spectra with fit and lines, stabilisation diagram and subsets by level of a window, from its samples."""

    vehicle: str
    boot: int
    number: int
    t0: int
    spectra: WindowSpectra
    fit: SpectraFit | None = Field(description="null if the vehicle is not fitted")
    stabilisation: Stabilisation
    identification: dict[str, Any] = Field(description="modes and lines of the window, sprung.identification/1")
    levels: dict[str, Any] | None = Field(
        description="modes of the segments sorted by level, sprung.identification/1; null if they cannot be sorted"
    )
    notes: tuple[str, ...] = Field(description="why a part is missing")


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
        Reason why there are none; None where there are.
    """

    values: Mapping[str, Any] = field(default_factory=dict)
    pictures: Mapping[str, str] = field(default_factory=dict)
    error: str | None = None


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
        limit: float = LIMITS.diagrams_timeout,
    ) -> None:
        self._command = command
        self._limit = limit
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
        key = json.dumps(request, sort_keys=True)
        with self._lock:
            if again and key in self._kept and self._kept[key].error:
                del self._kept[key]
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
            if self._present and self._present != key:
                raise BusyError("diagrams of another window are being computed")
            if not self._present and not self._is_closed:
                self._present = key
                threading.Thread(target=self._run, args=(key,), name="diagrams", daemon=True).start()
        raise BusyError("the diagrams are being computed from the samples")

    def close(self) -> None:
        """End what is under way, and begin nothing more."""
        with self._lock:
            self._is_closed = True
            if self._process is not None:
                self._process.kill()

    def _run(self, key: str) -> None:
        """Compute, and keep the result."""
        computed = Computed(error="their process failed")
        try:
            computed = self._computed(key)
        finally:
            with self._lock:
                self._kept[key] = computed
                while len(self._kept) > LIMITS.max_kept_diagrams:
                    self._kept.popitem(last=False)
                self._present, self._process = "", None

    def _computed(self, request: str) -> Computed:
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
            output, _ = process.communicate(request.encode(), timeout=self._limit)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            return Computed(error=f"they took longer than {self._limit:g} s")
        with suppress(ValueError, KeyError, TypeError):
            answer = json.loads(output) if len(output) <= LIMITS.max_diagrams else {}
            return Computed(error=answer["error"]) if "error" in answer else Computed(**answer)
        return Computed(error=f"their process failed (exit code {process.returncode})")


@api.get("/vehicles/{vehicle}/windows/{boot}/{number}/diagrams")
def diagrams(request: Request, _: Viewer, entry: KnownWindow) -> WindowDiagrams:
    """Spectra, stabilisation diagram and subsets by level of a window; 503 with retry-after while they are computed."""
    return shown_diagrams(entry, computed_diagrams(request, entry))


@api.get("/vehicles/{vehicle}/windows/{boot}/{number}/figures/{figure}", response_class=Response)
def figure(request: Request, _: Viewer, entry: KnownWindow, figure: Figure) -> Response:
    """Figure of the diagrams of a window as SVG; 503 with retry-after while they are computed."""
    computed = computed_diagrams(request, entry)
    if figure not in computed.pictures:
        notes = computed.error or "; ".join(computed.values.get("notes", ()))
        raise HTTPException(404, f"there is no figure {figure}: {notes}")
    picture = computed.pictures[figure].encode()
    headers = {"cache-control": "no-store", "vary": "accept-encoding"}
    if "gzip" in request.headers.get("accept-encoding", ""):
        picture = gzip.compress(picture, 6)
        headers["content-encoding"] = "gzip"
    return Response(picture, media_type="image/svg+xml", headers=headers)


@pages.get("/vehicles/{vehicle}/diagrams")
def show_last(request: Request, context: Shared, _: Viewer, row: KnownVehicle) -> Response:
    """Show the diagrams of the last window whose samples are kept."""
    vehicle = row.vehicle
    entries = context.store.results.observations(vehicle, limit=LIMITS.max_sought)
    for entry in reversed(entries):
        if _samples(context, entry) is not None:
            return RedirectResponse(f"{path_of(vehicle)}/windows/{entry.boot}/{entry.number}/diagrams", 303)
    return vehicle_page(
        request,
        "vehicle-diagrams.html",
        vehicle,
        tab="/diagrams",
        window=None,
        n_windows=len(entries),
        is_kept=context.site.archive is not None,
        days=context.site.keep.raw_days,
    )


@pages.get("/vehicles/{vehicle}/windows/{boot}/{number}/diagrams")
def show(request: Request, context: Shared, person: Viewer, entry: KnownWindow, *, again: bool = False) -> Response:
    """Show the diagrams of a window, or that they are being computed."""
    shown: dict[str, Any] = {"diagrams": None, "busy": "", "problem": "", "failed": False}
    try:
        computed = computed_diagrams(request, entry, again=again)
        shown["failed"] = bool(computed.error)
        values = shown_diagrams(entry, computed)
        poles = Counter(status for each in values.stabilisation.poles for status in each.status)
        shown |= {"diagrams": values, "pictures": tuple(computed.pictures), "counts": poles.most_common()}
    except BusyError as error:
        shown["busy"] = error.detail
    except NoSamplesError as error:
        shown["problem"] = error.detail
    detail = window(context, person, entry)
    return vehicle_page(request, "vehicle-diagrams.html", entry.vehicle, tab="/diagrams", window=detail, **shown)


def computed_diagrams(request: Request, entry: Entry, *, again: bool = False) -> Computed:
    """Return the diagrams of a window, or why they cannot be computed; begin to compute them if they are not kept.

    Parameters
    ----------
    request
        Request for them.
    entry
        The window.
    again
        Whether diagrams that could not be computed are tried again.

    Raises
    ------
    NoSamplesError
        If its samples are not kept.
    BusyError
        If these diagrams, or others, are being computed.
    """
    context = context_of(request)
    keep = context.site.keep
    path = _samples(context, entry)
    if context.site.archive is None:
        raise NoSamplesError(
            "Diagrams are computed from samples, and this monitor keeps none: set keep.raw_days in the site file to "
            "the number of days"
        )
    if path is None:
        raise NoSamplesError(
            f"The samples of this window are no longer kept: the site file keeps them for {keep.raw_days:g} days "
            f"(keep.raw_days) and up to {keep.raw_gigabytes:g} GB of all vehicles (keep.raw_gigabytes); larger values "
            "keep those of later windows longer"
        )
    row = require_vehicle(context, entry.vehicle)
    baseline = reference_of(context.store.results.baselines(entry.vehicle)).baseline
    completed = "" if baseline is None else baseline.vehicle_file  # the one that the baseline is in terms of
    desk: DiagramDesk = request.app.state.diagrams
    return desk.take(
        {
            "samples": str(path),
            "quantities": dict(row.channels),
            "description": completed or row.description,
            "method": context.site.watch.method,
            "source": f"{entry.vehicle}, {format_time(entry.t0)} UTC",
        },
        again=again,
    )


def shown_diagrams(entry: Entry, computed: Computed) -> WindowDiagrams:
    """Return the values of diagrams with their place.

    Raises
    ------
    NoSamplesError
        If they could not be computed.
    """
    if computed.error:
        raise NoSamplesError(f"The diagrams cannot be computed from the samples of this window: {computed.error}")
    place = {"vehicle": entry.vehicle, "boot": entry.boot, "number": entry.number, "t0": entry.t0}
    return WindowDiagrams.model_validate({**place, **computed.values})


def _samples(context: Context, entry: Entry) -> Path | None:
    """Return the file of the samples of a window; None if they are not kept."""
    if context.site.archive is None:
        return None
    try:
        path = archive_path(context.site.archive, entry.vehicle, entry.boot, entry.number, entry.t0)
    except ParameterError:  # a name that cannot be that of a folder
        return None
    return path if path.exists() else None
