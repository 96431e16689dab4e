"""Completion of a vehicle file from the first windows of a learning phase."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from sprung.calibration import (
    CALIBRATION_WINDOWS,
    Calibration,
    WindowSpectra,
    calibrated,
    calibrated_if_imperfect,
    usable_spectra,
    window_layouts,
)
from sprung.diagnosis import Observation
from sprung.likelihood import SegmentSpectra
from sprung.recording import Recording
from sprung.vehicles import Vehicle

#: Apparent sensor faults that a wrong place, gain or delay in the file can cause.
_SEEMING = frozenset({"noisy", "wrong_gain", "time_shifted"})


class Completion:
    """Collects windows of a learning phase, and calibrates the vehicle file on them if it is imperfect.

    Parameters
    ----------
    is_wanted
        Whether the file is calibrated; None: if it fits the windows badly or misplaces sensors.

    Notes
    -----
    Three windows are held as spectra in single precision until the decision: 0.5 MB each with four sensors in ten
    minutes, and released then. Windows without a speed or with a broken sensor are skipped.
    """

    def __init__(self, *, is_wanted: bool | None) -> None:
        self._is_wanted = is_wanted
        self._spectra: tuple[WindowSpectra, ...] = ()
        self._model_errors: list[float] = []
        self._is_open = is_wanted is not False

    @property
    def is_open(self) -> bool:
        """Whether the decision is still to be made."""
        return self._is_open

    def update(
        self, recording: Recording, observation: Observation, vehicle: Vehicle, *, is_last: bool
    ) -> Calibration | None:
        """Add a window, and return the calibration if this was the last one needed and it improves the file.

        Parameters
        ----------
        recording
            Window as read.
        observation
            Its observation.
        vehicle
            Vehicle as its file describes it.
        is_last
            Whether the baseline needs no further window, so that the decision is due.
        """
        self._model_errors.append(observation.conditions.get("model_error", float("inf")))
        if all(fault.kind in _SEEMING for fault in observation.sensor_faults):
            for window in usable_spectra([recording], vehicle):
                if not self._spectra or window.layout.names == self._spectra[0].layout.names:
                    self._spectra = (*self._spectra, _rounded(window))
        if not (self._spectra and (is_last or len(self._spectra) == CALIBRATION_WINDOWS)):
            return None
        windows, errors = self._spectra, self._model_errors
        self._is_open = False
        self._spectra = ()
        self._model_errors = []
        if self._is_wanted:
            return calibrated(windows, vehicle)
        return calibrated_if_imperfect(windows, vehicle, model_errors=errors)

    def state(self) -> dict[str, Any]:
        """Return everything that is needed to continue, as plain values and bytes."""
        return {
            "is_open": self._is_open,
            "model_errors": self._model_errors,
            "windows": [_stored(window) for window in self._spectra],
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any], vehicle: Vehicle, *, is_wanted: bool | None) -> "Completion":
        """Return the completion that continues from a state, of the same vehicle."""
        completion = cls(is_wanted=is_wanted)
        completion._is_open = bool(state["is_open"])
        completion._model_errors = [float(error) for error in state["model_errors"]]
        completion._spectra = tuple(_restored(stored, vehicle) for stored in state["windows"])
        return completion


def _rounded(window: WindowSpectra) -> WindowSpectra:
    """Return spectra in single precision, so that a restart changes nothing."""
    values = window.segments.values.astype(np.complex64).astype(np.complex128)
    return replace(window, segments=replace(window.segments, values=values))


def _stored(window: WindowSpectra) -> dict[str, Any]:
    """Return spectra as plain values and bytes."""
    segments = window.segments
    return {
        "channels": list(window.layout.names),
        "kind": window.kind,
        "frequencies": segments.frequencies.astype("<f8").tobytes(),
        "values": segments.values.astype("<c8").tobytes(),
        "speeds": segments.speeds.astype("<f8").tobytes(),
        "spreads": segments.spreads.astype("<f8").tobytes(),
        "segment_length": segments.segment_length,
        "n_rejected": segments.n_rejected,
    }


def _restored(stored: Mapping[str, Any], vehicle: Vehicle) -> WindowSpectra:
    """Return the spectra of plain values and bytes."""
    frequencies, speeds, spreads = (np.frombuffer(stored[name], dtype="<f8") for name in _REALS)
    layout, rigid = window_layouts(vehicle, tuple(stored["channels"]))
    values = np.frombuffer(stored["values"], dtype="<c8").reshape(speeds.size, frequencies.size, -1)
    segments = SegmentSpectra(
        frequencies=frequencies,
        values=values,
        speeds=speeds,
        spreads=spreads,
        segment_length=stored["segment_length"],
        n_rejected=stored["n_rejected"],
    )
    return WindowSpectra(segments, layout, rigid, stored["kind"])


_REALS = ("frequencies", "speeds", "spreads")
