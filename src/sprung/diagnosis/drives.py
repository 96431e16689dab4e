"""A drive as `sprung corners` fits it: from nominal values, and from modes identified in the same recordings."""

from collections.abc import Iterable

from sprung.errors import DataError, IdentificationError
from sprung.identification import IdentificationSettings, cov_ssi
from sprung.likelihood import CornerFit, CornerSettings, fit_corners
from sprung.modal import Modes
from sprung.recording import Recording, each_recording
from sprung.vehicles import Vehicle


def fit_drive(
    recordings: Recording | Iterable[Recording],
    vehicle: Vehicle,
    *,
    settings: CornerSettings | None = None,
    allow_missing: bool = False,
) -> CornerFit:
    """Fit springs, dampers and tyres of every corner to a drive, with a second start from identified modes.

    Parameters
    ----------
    recordings
        Recordings of one condition, as for `sprung.likelihood.fit_corners`.
    vehicle
        Vehicle with its sensors.
    settings
        Choices of the fit; None: all from the vehicle.
    allow_missing
        Whether the recordings may lack sensors of the vehicle file; a note then says which.

    Returns
    -------
    CornerFit
        With the estimates by modes alone in `from_modes`, where the recordings have modes.

    Raises
    ------
    DataError, ParameterError
        As from `sprung.likelihood.fit_corners`.
    """
    records = list(each_recording(recordings))
    modes = _modes(records, vehicle, allow_missing=allow_missing)
    return fit_corners(records, vehicle, settings=settings, modes=modes, allow_missing=allow_missing)


def _modes(recordings: list[Recording], vehicle: Vehicle, *, allow_missing: bool) -> Modes | None:
    """Return the modes in recordings; None where there are none."""
    try:
        settings = IdentificationSettings(has_road_modes=False, refine=False, allow_missing=allow_missing)
        return cov_ssi(recordings, settings=settings, vehicle=vehicle).modes
    except (DataError, IdentificationError):
        return None
