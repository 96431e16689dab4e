"""Corners, calibrations and bounce tests as tables and sentences."""

from typing import TYPE_CHECKING

import numpy as np

from sprung._display import counted
from sprung.likelihood import CornerFit, run_out
from sprung.results.tables.identification import describe_shapes
from sprung.results.tables.wording import Table, format_estimate, format_name
from sprung.vehicles.structure import DAMPERS, SPRINGS

if TYPE_CHECKING:
    from sprung.bounce_tests import Bounce
    from sprung.calibration import CalibratedNumber, Calibration

#: Letters of the longest bar, and the relative change at which it is reached.
_BAR, _FULL = 8, 0.4
_UNITS = {**dict.fromkeys((*SPRINGS, "tyre"), "N/m"), **dict.fromkeys(DAMPERS, "N s/m")}


def components_table(fit: CornerFit) -> Table:
    """Return the table of fitted springs, dampers and tyres, with bars of their change from nominal.

    Examples
    --------
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=30.0, sampling_rate=60.0, snr=50.0), seed=1)
    >>> fit = fit_corners(drive.recording, vehicle)
    >>> table = components_table(fit)
    >>> [row[:2] for row in table.rows[:3]]
    [('front left', 'spring [N/m]'), ('front left', 'damper [N s/m]'), ('front left', 'tyre [N/m]')]
    """
    columns = ("corner", "component", "value", "from nominal [%]", f"-{100 * _FULL:.0f} % .. +{100 * _FULL:.0f} %")
    rows = []
    for row, component in enumerate(fit.components):
        value, change = fit.values[row], float(fit.values[row] / fit.nominal[row] - 1)
        estimate = format_estimate(value, value * fit.log_ratios_std[row])
        numbers = (estimate, f"{100 * change:+z.1f}", _bar(change))
        unknown = ("–", "–", "not identifiable")
        kind = f"{format_name(component.kind)} [{_UNITS.get(component.kind, '-')}]"
        rows.append((format_name(component.corner), kind, *(numbers if fit.is_identifiable[row] else unknown)))
    return Table("Corners", columns, tuple(rows), n_words=2, caption="± standard deviation")


def fitted_modes_table(fit: CornerFit) -> Table:
    """Return the table of the modes of a fitted vehicle.

    Examples
    --------
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=30.0, sampling_rate=60.0, snr=50.0), seed=1)
    >>> fit = fit_corners(drive.recording, vehicle)
    >>> table = fitted_modes_table(fit)
    >>> table.columns, [row[-1] for row in table.rows[:4]]
    (('frequency [Hz]', 'damping [%]', 'label'), ['bounce', 'pitch', 'roll', 'wheel hop'])
    """
    modes, (frequency_std, damping_std) = fit.modes(), fit.modes_std()
    rows = tuple(
        (
            format_estimate(modes.natural_frequency[k], frequency_std[k]),
            format_estimate(100 * modes.damping_ratio[k], 100 * damping_std[k]),
            format_name(modes.labels[k] or ""),
        )
        for k in range(modes.poles.size)
    )
    columns = ("frequency [Hz]", "damping [%]", "label")
    return Table("Modes of the fitted vehicle", columns, rows, n_words=0)


def run_out_tables(fit: CornerFit) -> list[Table]:
    """Return the table of the wheels' run-out; none where no line of the wheels stands out.

    Examples
    --------
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, WheelOrders, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle, wheels = read_vehicle("zafira"), WheelOrders(run_out=(1e-3,), wheels=("rear_left",))
    >>> settings = RoadDrive(duration=120.0, sampling_rate=60.0, speed=(10.0, 20.0), snr=50.0, wheel_orders=wheels)
    >>> (table,) = run_out_tables(fit_corners(simulate_drive(vehicle, settings, seed=1).recording, vehicle))
    >>> table.columns, [row[0] for row in table.rows]
    (('wheel', 'run-out, RMS [mm]'), ['front left', 'front right', 'rear left', 'rear right'])
    """
    found = run_out(fit)
    if found is None:
        return []
    rows = tuple(
        (format_name(name), format_estimate(1e3 * value, 1e3 * std))
        for name, value, std in zip(found.wheels, found.values.tolist(), found.stds.tolist(), strict=True)
    )
    caption = f"± standard deviation; of turns of {found.circumference:.2f} m. An unbalanced wheel has a run-out, too."
    return [Table("Wheels", ("wheel", "run-out, RMS [mm]"), rows, n_words=1, caption=caption)]


def describe_payload(fit: CornerFit) -> list[str]:
    """Return a sentence about the fitted payload; none where it was not fitted.

    Examples
    --------
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=30.0, sampling_rate=60.0, snr=50.0), seed=1)
    >>> fit = fit_corners(drive.recording, vehicle)
    >>> (sentence,) = describe_payload(fit)
    >>> sentence.startswith("payload: "), sentence.endswith(" kg")
    (True, True)
    """
    mass = fit.payload.get("payload_mass")
    return [] if mass is None else [f"payload: {mass['value']:z.0f} ± {mass['std']:.0f} kg"]


def _bar(change: float) -> str:
    """Draw a change as a bar to the left or right of a middle line."""
    length = min(_BAR, round(abs(change) / _FULL * _BAR))
    left = ("█" * length).rjust(_BAR) if change < 0 else " " * _BAR
    return f"{left}│{'█' * length if change >= 0 else ''}"


#: Groups whose parameters are listed only if the drives determine them.
_MINOR = {"sides", "sensors"}


def calibration_table(calibration: "Calibration") -> Table:
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
    rows = tuple(
        _number_cells(number) for number in calibration.learnt if number.is_identifiable or number.group not in _MINOR
    )
    columns = ("parameter", "given", "learnt", "change", "from the drives")
    return Table("Parameters of the vehicle file", columns, rows, n_words=1, caption="± standard deviation")


def describe_calibration(calibration: "Calibration") -> list[str]:
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
    >>> describe_calibration(calibration)[0]
    'model error of the windows: 30 % before, 4 % after'
    """
    before, after = (
        ", ".join(f"{100 * error:.0f}" for error in errors)
        for errors in (calibration.model_errors_before, calibration.model_errors_after)
    )
    gain = f"gain in ln evidence over the given file: {calibration.evidence_gain:.0f}"
    return [f"model error of the windows: {before} % before, {after} % after", gain, *calibration.notes]


def _number_cells(number: "CalibratedNumber") -> tuple[str, ...]:
    """Return one line of the table."""
    unit = f" [{number.unit}]" if number.unit else ""
    given = "–" if number.nominal_value is None else f"{number.nominal_value:.5g}"
    change = ""
    if number.nominal_value:
        percent = f"{100 * (number.value / number.nominal_value - 1):+z.1f} %"
        change = f"{number.value - number.nominal_value:+.2g}" if number.unit in {"m", "s"} else percent
    determined = "yes" if number.is_identifiable else "no"
    return f"{number.name}{unit}", given, format_estimate(number.value, number.std), change, determined


_QUANTITIES = {
    "natural_frequency": "frequency",
    "damping_ratio": "damping",
    "value": "value",
    "left_over_right": "left over right",
}


def describe_bounce(bounce: "Bounce") -> str:
    """Return the number of tests and modes, and the largest change, in a line."""
    sizes = f"{counted(len(bounce.tests), 'test')}, {counted(len(bounce.modes), 'mode')}"
    if not bounce.changes:
        return sizes
    significant = [change for change in bounce.changes if change.is_significant]
    if not significant:
        return f"{sizes}; no change detected"
    largest = max(significant, key=lambda change: change.score)
    what = f"{format_name(largest.part)} {_QUANTITIES[largest.quantity]}".removesuffix(" value")
    return f"{sizes}; changed: {what} {100 * largest.change:+z.0f} %"


def bounce_tables(bounce: "Bounce") -> list[Table]:
    """Return the modes of all tests, the single tests, springs and dampers, and changes as tables."""
    tables = [_modes_table(bounce), _tests_table(bounce)]
    known = [value for value in bounce.corners if value.is_identifiable]
    if known:
        rows = tuple(
            (
                format_name(value.component.corner),
                f"{value.component.kind} [{_UNITS[value.component.kind]}]",
                format_estimate(value.value, value.value * value.std),
                f"{100 * (value.value / value.nominal - 1):+z.1f}",
            )
            for value in known
        )
        columns = ("corner", "component", "value", "from nominal [%]")
        tables.append(Table("Corners", columns, rows, n_words=2, caption="± standard deviation"))
    for title, differences, verdicts in (
        ("Left against right", bounce.sides, ("no difference detected", "different")),
        ("Changes since the test before", bounce.changes, ("no change detected", "changed")),
    ):
        differing = tuple(
            (
                format_name(change.part),
                _QUANTITIES[change.quantity],
                f"{100 * change.change:+z.1f}",
                f"{100 * change.interval[0]:+z.1f} .. {100 * change.interval[1]:+z.1f}",
                verdicts[change.is_significant],
            )
            for change in differences
        )
        headings = ("part", "quantity", "difference [%]", "95 % [%]", "verdict")
        tables += [Table(title, headings, differing, n_words=2)] if differing else []
    return tables


def _modes_table(bounce: "Bounce") -> Table:
    """Return the modes of all tests together."""
    modes = bounce.modes
    shapes = describe_shapes(modes.channels, modes.mode_shapes)
    rows = tuple(
        (
            format_estimate(modes.natural_frequency[k], modes.natural_frequency_std[k]),
            format_estimate(100 * modes.damping_ratio[k], 100 * modes.damping_ratio_std[k]),
            format_name(modes.labels[k] or ""),
            shapes[k],
        )
        for k in range(len(modes))
    )
    columns = ("frequency [Hz]", "damping [%]", "label", "shape")
    return Table("Modes", columns, rows, n_words=0, caption="± standard deviation")


def _tests_table(bounce: "Bounce") -> Table:
    """Return the modes of each test, with friction where it is stated apart."""
    rows = []
    for number, test in enumerate(bounce.tests, start=1):
        modes = test.modes
        for k, fit in enumerate(test.frictions):
            friction = ("", "")
            if fit is not None:
                largest = float(np.max(np.abs(fit.amplitudes)))
                viscous = format_estimate(100 * fit.damping_ratio, 100 * fit.damping_ratio_std)
                friction = viscous, format_estimate(largest * fit.friction, largest * fit.friction_std)
            rows.append(
                (
                    str(number) if k == 0 else "",
                    f"{test.transient.onset:.1f}" if k == 0 else "",
                    format_estimate(modes.natural_frequency[k], modes.natural_frequency_std[k]),
                    format_estimate(100 * modes.damping_ratio[k], 100 * modes.damping_ratio_std[k]),
                    *friction,
                    f"{100 * test.residual:.1f}" if k == 0 else "",
                )
            )
    columns = ("test", "at [s]", "frequency [Hz]", "damping [%]", "viscous [%]", "sticks below", "left [%]")
    caption = "damping: with friction, of equal energy; sticks below: in the unit of travel; left: RMS not explained"
    return Table("Tests", columns, tuple(rows), n_words=0, caption=caption)
