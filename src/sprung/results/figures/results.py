"""The one picture of a value."""

from functools import singledispatch

from matplotlib.figure import Figure

from sprung.calibration import Calibration
from sprung.diagnosis import Diagnosis
from sprung.errors import ParameterError
from sprung.identification import Identification
from sprung.identification.tracking import TrackedModes
from sprung.likelihood import CornerFit
from sprung.modal import Modes
from sprung.results.figures.calibration import misfit_figure
from sprung.results.figures.corners import corners_figure
from sprung.results.figures.diagnosis import corner_changes_figure
from sprung.results.figures.shapes import shapes_figure
from sprung.results.figures.signals import histories_figure
from sprung.results.figures.stabilisation import stabilisation_figure
from sprung.results.figures.tracking import tracks_figure
from sprung.recording import Channel, Recording


@singledispatch
def picture_of(value: object) -> Figure:
    """Return the picture of a value.

    Parameters
    ----------
    value
        Recording: signals over time. Modes: mode shapes. Identification: stabilisation diagram. Tracked modes: modes
        over time. Corner fit: corners against nominal. Diagnosis: corners against the baseline. Calibration: misfit
        before and after.

    Raises
    ------
    ParameterError
        If a value of this type has no picture, or a diagnosis has no conclusive window.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> [axes.get_ylabel() for axes in picture_of(run).axes]
    ['acceleration [m/s²]']
    """
    raise ParameterError(f"a {type(value).__name__} has no picture of its own: see the functions of sprung.results.figures")


picture_of.register(Calibration, misfit_figure)
picture_of.register(CornerFit, corners_figure)
picture_of.register(Diagnosis, corner_changes_figure)
picture_of.register(Identification, stabilisation_figure)


@picture_of.register
def _of_recording(recording: Recording) -> Figure:
    return histories_figure([("", recording)], title="Signals")


@picture_of.register
def _of_modes(modes: Modes) -> Figure:
    return shapes_figure(modes, [Channel(name) for name in modes.channels])


@picture_of.register
def _of_tracks(tracked: TrackedModes) -> Figure:
    return tracks_figure(tracked, has_times=tracked.has_times)
