"""Channels for the sensor checks: their samples on the move, and the spectra of these."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sprung._arrays import Booleans, Real
from sprung.recording import Recording
from sprung.signals.spectrum import SpectralMatrix, spectral_matrix
from sprung.vehicles.window import Window

#: Speed above which a vehicle moves [m/s]: while it stands, sensors may well be constant.
_MOVING = 2.0
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
    """

    recording: Recording
    is_moving: Booleans

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels."""
        return self.recording.names

    @property
    def sampling_rate(self) -> float:
        """Sampling rate [Hz]."""
        return self.recording.sampling_rate

    @cached_property
    def samples(self) -> Real:
        """Samples on the move, gaps closed, shape (channels, samples)."""
        return self.recording.samples[:, self.is_moving]

    @cached_property
    def complete(self) -> Real:
        """Samples on the move with missing values on a straight line between their neighbours, 0 without any values."""
        is_known = np.isfinite(self.samples)
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
        """Return the rows of the other channels of the same quantity."""
        quantities = [channel.quantity for channel in self.recording.channels]
        return [k for k, quantity in enumerate(quantities) if quantity == quantities[row] and k != row]

    def select(self, names: Sequence[str]) -> "Channels":
        """Return only the channels in `names`."""
        return Channels(self.recording.select(names), self.is_moving)


def channels_of_motion(window: Window) -> Channels:
    """Return the channels of motion of a window; all samples count if the vehicle never moves."""
    recording = window.recording
    is_moving = np.ones(recording.n_samples, dtype=np.bool_)
    if window.speed is not None:
        is_fast = recording.samples[recording.index(window.speed)] > _MOVING
        is_moving = is_fast if is_fast.any() else is_moving
    return Channels(recording.select(window.outputs), is_moving)
