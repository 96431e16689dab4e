"""Diagrams of a window, as the interface returns and the pages show them. Frequencies in Hz, times in UTC ns."""

from typing import Any

from pydantic import Field

from sprung.online.site.models import Answer
from sprung.results.documents.document import Pair


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
