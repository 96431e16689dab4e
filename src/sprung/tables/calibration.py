"""Tables of a calibration."""

from sprung.calibration import CalibratedNumber, Calibration
from sprung.tables.table import Table, with_deviation

#: Groups whose parameters are listed only if the drives determine them.
_MINOR = {"sides", "sensors"}


def calibration_table(calibration: Calibration) -> Table:
    """Return the table of the parameters learnt from drives, next to those in the file."""
    rows = tuple(_row(number) for number in calibration.learnt if number.is_identifiable or number.group not in _MINOR)
    columns = ("parameter", "given", "learnt", "change", "from the drives")
    return Table("Parameters of the vehicle file", columns, rows, n_words=1, caption="± standard deviation")


def calibration_in_words(calibration: Calibration) -> list[str]:
    """Return sentences on the misfit before and after, and the notes."""
    before, after = (
        ", ".join(f"{100 * error:.0f}" for error in errors)
        for errors in (calibration.model_errors_before, calibration.model_errors_after)
    )
    gain = f"gain in ln evidence over the given file: {calibration.evidence_gain:.0f}"
    return [f"model error of the windows: {before} % before, {after} % after", gain, *calibration.notes]


def _row(number: CalibratedNumber) -> tuple[str, ...]:
    """Return one line of the table."""
    unit = f" [{number.unit}]" if number.unit else ""
    given = "–" if number.given is None else f"{number.given:.5g}"
    change = ""
    if number.given:
        percent = f"{100 * (number.value / number.given - 1):+.1f} %"
        change = f"{number.value - number.given:+.2g}" if number.unit in {"m", "s"} else percent
    determined = "yes" if number.is_identifiable else "no"
    return f"{number.name}{unit}", given, with_deviation(number.value, number.std), change, determined
