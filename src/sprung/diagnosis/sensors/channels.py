"""Channels for the sensor checks: their samples on the move, and the spectra of these."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sprung._arrays import Booleans, Real
from sprung.recording import Recording
from sprung.signals.data_faults import MOVING, has_runs
from sprung.signals.spectrum import SpectralMatrix, spectral_matrix
from sprung.vehicles import Sensor
from sprung.vehicles.window import Window

#: Length of segments of spectra [s], and smallest number of them for checks of spectra.
_SEGMENT, _FEWEST_SEGMENTS = 2.048, 4


@dataclass(frozen=True, eq=False)
class Channels:
    """Channels of motion of a window.

    Parameters
    ----------
    recording
        All samples of the channels, in SI units; missing values are NaN.
    is_moving
        Whether the vehicle moves at each sample, shape (samples,).
    carriers
        What each channel is on: "body", "wheel", "suspension" or another part.
    """

    recording: Recording
    is_moving: Booleans
    carriers: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels."""
        return self.recording.names

    @property
    def sampling_rate(self) -> float:
        """Sampling rate [Hz]."""
        return self.recording.sampling_rate

    @cached_property
    def have_runs(self) -> tuple[bool, ...]:
        """Whether each channel may be stuck or clipped, or has missing values."""
        return tuple(map(has_runs, self.recording.samples))

    @cached_property
    def samples(self) -> Real:
        """Samples on the move, gaps closed, shape (channels, samples)."""
        return self.recording.samples if self.is_moving.all() else self.recording.samples[:, self.is_moving]

    @cached_property
    def complete(self) -> Real:
        """Samples on the move with missing values on a straight line between their neighbours, 0 without any values."""
        is_known = np.isfinite(self.samples)
        if is_known.all():
            return self.samples
        complete = np.where(is_known, self.samples, 0.0)
        for values, known in zip(complete, is_known, strict=True):
            if known.any() and not known.all():
                places = np.flatnonzero(known)
                values[~known] = np.interp(np.flatnonzero(~known), places, values[places])
        return complete

    @cached_property
    def spectra(self) -> SpectralMatrix:
        """Spectral matrix of the samples on the move."""
        moving = replace(self.recording, samples=self.complete, gaps=())
        return spectral_matrix(moving, segment_length=_SEGMENT)

    @property
    def has_spectra(self) -> bool:
        """Whether there are channels, and enough samples on the move for spectra."""
        enough = _FEWEST_SEGMENTS * _SEGMENT * self.sampling_rate
        return bool(self.names) and self.samples.shape[1] >= enough

    def peers(self, row: int) -> list[int]:
        """Return the rows of the other channels of the same quantity on the same kind of part."""
        quantities = [channel.quantity for channel in self.recording.channels]
        kinds = list(zip(quantities, self.carriers, strict=True))
        return [k for k, kind in enumerate(kinds) if kind == kinds[row] and k != row]

    def select(self, names: Sequence[str]) -> "Channels":
        """Return only the channels in `names`."""
        carriers = tuple(self.carriers[self.recording.index(name)] for name in names)
        return Channels(self.recording.select(names), self.is_moving, carriers)


def channels_of_motion(window: Window) -> Channels:
    """Return the channels of motion of a window; all samples count if the vehicle never moves."""
    recording = window.recording
    is_moving = np.ones(recording.n_samples, dtype=np.bool_)
    if window.speed is not None:
        is_fast = recording.samples[recording.index(window.speed)] > MOVING
        is_moving = is_fast if is_fast.any() else is_moving
    carriers = {sensor.channel: _carrier(sensor) for sensor in window.vehicle.sensor}
    return Channels(recording.select(window.outputs), is_moving, tuple(carriers[name] for name in window.outputs))


def _carrier(sensor: Sensor) -> str:
    """Return the kind of part that a sensor is on."""
    return "suspension" if sensor.between else "wheel" if sensor.on.startswith("wheel") else sensor.on
