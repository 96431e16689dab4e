"""Result of a calibration: numbers of the vehicle with their uncertainty, and the misfit before and after."""

from dataclasses import dataclass

from sprung._arrays import Real
from sprung._checks import freeze
from sprung._display import Drawable, Savable, Tabular, counted, in_short
from sprung.vehicles import Vehicle

#: Gain in ln evidence that counts as an improvement: far more than chance, as models are never perfect.
CONVINCING = 10.0


@dataclass(frozen=True, slots=True)
class CalibratedNumber:
    """A number of the vehicle after calibration.

    Parameters
    ----------
    name
        Place of the number in the file, such as "front.tyre_stiffness", "acc_fl.x" or "speed_scale".
    group
        Kind of number: "components", "sides", "body", "wheels", "sensors", "mounted_masses", "modes", "speed".
    unit
        Unit of the values.
    nominal_value
        Value of the file; None if the file lacks it.
    value, std
        Learnt value and its standard deviation.
    prior_std
        Standard deviation before any data.
    is_identifiable
        Whether the drives determine it: the data halve its standard deviation at least. The others stay near the given
        value.
    """

    name: str
    group: str
    unit: str
    nominal_value: float | None
    value: float
    std: float
    prior_std: float
    is_identifiable: bool


@dataclass(frozen=True, eq=False, slots=True)
class Calibration(Tabular, Savable, Drawable):
    """A vehicle file completed from drives.

    Parameters
    ----------
    vehicle
        Completed vehicle.
    learnt
        Numbers that were free, identifiable or not.
    coordinates
        Coordinates of the misfit, before and after: what the vehicle of the given file explains.
    frequencies
        Frequencies of the misfit [Hz], shape (frequencies,).
    misfit_before, misfit_after
        Measured over fitted power less 1 in joint fits of the windows, averaged over them: with springs, dampers and
        tyres free and all else as given, and as completed; shape (coordinates, frequencies).
    model_errors_before, model_errors_after
        Model error of each window in these fits.
    evidence_gain
        Gain in ln evidence of the completed file over the given one, in all channels of all windows.
    n_segments
        Number of segments of each window.
    notes
        Remarks, one sentence each.
    """

    vehicle: Vehicle
    learnt: tuple[CalibratedNumber, ...]
    coordinates: tuple[str, ...]
    frequencies: Real
    misfit_before: Real
    misfit_after: Real
    model_errors_before: tuple[float, ...]
    model_errors_after: tuple[float, ...]
    evidence_gain: float
    n_segments: tuple[int, ...]
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        freeze(self, frequencies=1, misfit_before=2, misfit_after=2)

    def __repr__(self) -> str:
        """Return the numbers learnt, the gain in evidence and the first note."""
        learnt = sum(number.is_identifiable for number in self.learnt)
        numbers = f"{learnt} of {counted(len(self.learnt), 'number')} determined by {counted(self.n_windows, 'window')}"
        gain = f"gain in ln evidence over the given file: {self.evidence_gain:.0f}"
        return in_short(f"Calibration of {self.vehicle.name!r}: {numbers}", gain, *self.notes[:1])

    @property
    def n_windows(self) -> int:
        """Number of windows."""
        return len(self.n_segments)

    @property
    def is_better(self) -> bool:
        """Whether the completed file explains the windows better than the given one, far beyond chance."""
        return self.evidence_gain > CONVINCING

    def number(self, name: str) -> CalibratedNumber:
        """Return a learnt number by its name; KeyError if it was not free."""
        return {number.name: number for number in self.learnt}[name]
