"""Tables of a calibration."""

from sprung.calibration import CalibratedNumber, Calibration
from sprung.results.tables.table import Table, with_deviation

#: Groups whose parameters are listed only if the drives determine them.
_MINOR = {"sides", "sensors"}


def calibration_table(calibration: Calibration) -> Table:
    """Return the table of the numbers learnt from drives, next to those that the file stated.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.calibration import CalibratedNumber, Calibration
    >>> from sprung.vehicles import read_vehicle
    >>> place = CalibratedNumber("acc_fl.x", "sensors", "m", 1.22, 1.3, 0.01, 0.1, is_identifiable=True)
    >>> vehicle, f, misfit = read_vehicle("zafira"), np.linspace(1, 20, 39), np.full((1, 39), 0.5)
    >>> misfits = {"misfit_before": misfit, "misfit_after": misfit / 5}
    >>> errors = {"model_errors_before": (0.3,), "model_errors_after": (0.04,), "evidence_gain": 120.0}
    >>> rest = {**misfits, **errors, "n_segments": (200,), "notes": ()}
    >>> calibration = Calibration(vehicle, (place,), ("bounce",), f, **rest)
    >>> table = calibration_table(calibration)
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    parameter | given | learnt | change | from the drives
    acc_fl.x [m] | 1.22 | 1.300 ± 0.010 | +0.08 | yes
    """
    rows = tuple(_row(number) for number in calibration.learnt if number.is_identifiable or number.group not in _MINOR)
    columns = ("parameter", "given", "learnt", "change", "from the drives")
    return Table("Parameters of the vehicle file", columns, rows, n_words=1, caption="± standard deviation")


def calibration_in_words(calibration: Calibration) -> list[str]:
    """Return sentences on the misfit before and after, and the notes.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.calibration import CalibratedNumber, Calibration
    >>> from sprung.vehicles import read_vehicle
    >>> place = CalibratedNumber("acc_fl.x", "sensors", "m", 1.22, 1.3, 0.01, 0.1, is_identifiable=True)
    >>> vehicle, f, misfit = read_vehicle("zafira"), np.linspace(1, 20, 39), np.full((1, 39), 0.5)
    >>> misfits = {"misfit_before": misfit, "misfit_after": misfit / 5}
    >>> errors = {"model_errors_before": (0.3,), "model_errors_after": (0.04,), "evidence_gain": 120.0}
    >>> rest = {**misfits, **errors, "n_segments": (200,), "notes": ()}
    >>> calibration = Calibration(vehicle, (place,), ("bounce",), f, **rest)
    >>> calibration_in_words(calibration)[0]
    'model error of the windows: 30 % before, 4 % after'
    """
    before, after = (
        ", ".join(f"{100 * error:.0f}" for error in errors)
        for errors in (calibration.model_errors_before, calibration.model_errors_after)
    )
    gain = f"gain in ln evidence over the given file: {calibration.evidence_gain:.0f}"
    return [f"model error of the windows: {before} % before, {after} % after", gain, *calibration.notes]


def _row(number: CalibratedNumber) -> tuple[str, ...]:
    """Return one line of the table."""
    unit = f" [{number.unit}]" if number.unit else ""
    given = "–" if number.nominal_value is None else f"{number.nominal_value:.5g}"
    change = ""
    if number.nominal_value:
        percent = f"{100 * (number.value / number.nominal_value - 1):+.1f} %"
        change = f"{number.value - number.nominal_value:+.2g}" if number.unit in {"m", "s"} else percent
    determined = "yes" if number.is_identifiable else "no"
    return f"{number.name}{unit}", given, with_deviation(number.value, number.std), change, determined
