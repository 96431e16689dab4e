"""Modes of one window or run of many, or the reason why it has none."""

from dataclasses import dataclass

from sprung.errors import DataError, IdentificationError
from sprung.identification.methods import METHODS
from sprung.identification.settings import IdentificationSettings
from sprung.modal import Modes
from sprung.recording import Recording
from sprung.vehicles.plausibility import plausibility_notes
from sprung.vehicles.sensor_layout import layout_notes
from sprung.vehicles.usable import AnyVehicle


@dataclass(frozen=True, eq=False, slots=True)
class WindowModes:
    """Modes of a window.

    Parameters
    ----------
    time
        Time of its first sample since that of the first window [s], or its number.
    source
        Name of its file.
    modes
        Modes; None where the window could not be analysed.
    reason
        Why there are no modes; empty otherwise.
    notes
        Unusual motion of the vehicle file, sensors that the window lacks, and channels that the file does not name, in
        words.
    """

    time: float
    source: str
    modes: Modes | None
    reason: str = ""
    notes: tuple[str, ...] = ()


def identify_window(
    recording: Recording,
    *,
    time: float,
    source: str,
    method: str = "cov",
    settings: IdentificationSettings | None = None,
    vehicle: AnyVehicle | None = None,
) -> WindowModes:
    """Identify the modes of one window of many.

    Parameters
    ----------
    recording
        Window as read.
    time, source
        Time of the window and name of its file.
    method
        Name of a method, such as "cov".
    settings, vehicle
        As for `cov_ssi`.

    Raises
    ------
    ParameterError
        If a setting does not suit the recording, or it lacks a sensor of the vehicle file. A window that is too short
        or has dead channels is no error.
    """
    notes = () if vehicle is None else (*plausibility_notes(vehicle), *layout_notes(recording, vehicle))
    try:
        modes = METHODS[method](recording, settings=settings, vehicle=vehicle).modes
    except (DataError, IdentificationError) as error:
        return WindowModes(time, source, None, str(error), notes)
    return WindowModes(time, source, modes, "" if len(modes) else "no mode found", notes)
