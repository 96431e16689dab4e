"""Corners, calibrations and inspected recordings as tables and sentences."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from sprung.calibration import CalibratedNumber, Calibration
from sprung.likelihood import CornerFit
from sprung.results.tables.table import Table, in_words, with_deviation
from sprung.signals.inspection import ChannelFacts, Inspection

#: Letters of the longest bar, and the relative change at which it is reached.
_BAR, _FULL = 8, 0.4
_UNITS = {"spring": "N/m", "damper": "N s/m", "tyre": "N/m"}


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
        estimate = with_deviation(value, value * fit.log_ratios_std[row])
        numbers = (estimate, f"{100 * change:+.1f}", _bar(change))
        unknown = ("–", "–", "not identifiable")
        kind = f"{component.kind} [{_UNITS.get(component.kind, '-')}]"
        rows.append((in_words(component.corner), kind, *(numbers if fit.is_identifiable[row] else unknown)))
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
            with_deviation(modes.natural_frequency[k], frequency_std[k]),
            with_deviation(100 * modes.damping_ratio[k], 100 * damping_std[k]),
            in_words(modes.labels[k] or ""),
        )
        for k in range(modes.poles.size)
    )
    columns = ("frequency [Hz]", "damping [%]", "label")
    return Table("Modes of the fitted vehicle", columns, rows, n_words=0)


def payload_in_words(fit: CornerFit) -> list[str]:
    """Return a sentence about the fitted payload; none where it was not fitted.

    Examples
    --------
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=30.0, sampling_rate=60.0, snr=50.0), seed=1)
    >>> fit = fit_corners(drive.recording, vehicle)
    >>> (sentence,) = payload_in_words(fit)
    >>> sentence.startswith("payload: "), sentence.endswith(" kg")
    (True, True)
    """
    mass = fit.payload.get("payload_mass")
    return [] if mass is None else [f"payload: {mass['value']:.0f} ± {mass['std']:.0f} kg"]


def _bar(change: float) -> str:
    """Draw a change as a bar to the left or right of a middle line."""
    length = min(_BAR, round(abs(change) / _FULL * _BAR))
    left = ("█" * length).rjust(_BAR) if change < 0 else " " * _BAR
    return f"{left}│{'█' * length if change >= 0 else ''}"


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
    rows = tuple(
        _number_cells(number) for number in calibration.learnt if number.is_identifiable or number.group not in _MINOR
    )
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


def _number_cells(number: CalibratedNumber) -> tuple[str, ...]:
    """Return one line of the table."""
    unit = f" [{number.unit}]" if number.unit else ""
    given = "–" if number.nominal_value is None else f"{number.nominal_value:.5g}"
    change = ""
    if number.nominal_value:
        percent = f"{100 * (number.value / number.nominal_value - 1):+.1f} %"
        change = f"{number.value - number.nominal_value:+.2g}" if number.unit in {"m", "s"} else percent
    determined = "yes" if number.is_identifiable else "no"
    return f"{number.name}{unit}", given, with_deviation(number.value, number.std), change, determined


def true_modes_table(truth: Mapping[str, Any]) -> Table:
    """Return the table of the exact modes of a simulated recording, from its `sprung.truth/1`.

    Examples
    --------
    >>> mode = {"natural_frequency": 12.0, "damping_ratio": 0.24, "label": "wheel_hop"}
    >>> table = true_modes_table({"modes": [mode]})
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    frequency [Hz] | damping [%] | label
    12.00 | 24.00 | wheel hop
    """
    rows = tuple(
        (
            f"{mode['natural_frequency']:#.4g}",
            f"{100 * mode['damping_ratio']:#.4g}",
            in_words(mode["label"] or ""),
        )
        for mode in truth["modes"]
    )
    return Table("True modes", ("frequency [Hz]", "damping [%]", "label"), rows, n_words=0)


def inspection_table(inspection: Inspection) -> Table:
    """Return the table of the channels of a recording: levels and faults.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> import sprung
    >>> table = inspection_table(sprung.inspect(run))
    >>> row = dict(zip(table.columns, table.rows[0]))
    >>> [(name, row[name]) for name in ("unit", "RMS", "lowest", "highest")]
    [('unit', 'm/s^2'), ('RMS', '3'), ('lowest', '-4.243'), ('highest', '4.243')]
    """
    columns = ("channel", "quantity", "unit", "mean", "RMS", "lowest", "highest", "remarks")
    return Table("", columns, tuple(_channel_cells(facts) for facts in inspection.channels), n_words=3)


def inspection_in_words(inspection: Inspection) -> str:
    """Return length, rate, gaps and start of a recording in one line.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> import sprung
    >>> inspection_in_words(sprung.inspect(run))
    '4000 samples at 100 Hz: 40 s, no gaps'
    """
    length = f"{inspection.n_samples} samples at {inspection.sampling_rate:.8g} Hz: {_time(inspection.duration)}"
    gaps = "no gaps"
    if inspection.n_gaps:
        gaps = f"{inspection.n_gaps} gap{'s' * (inspection.n_gaps > 1)} of {_time(inspection.gap_duration)} in all"
    start = ""
    if inspection.start is not None:
        start = f", from {datetime.fromtimestamp(inspection.start // 10**9, tz=UTC):%Y-%m-%d %H:%M:%S} UTC"
    return f"{length}, {gaps}{start}"


def _time(seconds: float) -> str:
    """Return a duration in its natural unit."""
    if seconds < 120:
        return f"{seconds:.4g} s"
    return f"{seconds / 60:.4g} min" if seconds < 7200 else f"{seconds / 3600:.4g} h"


def _channel_cells(facts: ChannelFacts) -> tuple[str, ...]:
    """Return a channel's row of the table."""
    levels = (facts.mean, facts.rms, facts.minimum, facts.maximum)
    numbers = ("" if level is None else f"{level:.4g}" for level in levels)
    return (facts.name, facts.quantity, facts.unit, *numbers, _remarks(facts))


def _remarks(facts: ChannelFacts) -> str:
    """Return the faults of a channel in words."""
    shares = {
        "half-dead": facts.stuck,
        "stuck": facts.stuck,
        "clipped": facts.clipped,
        "filled": facts.fillers,
        "repeating": facts.repeated,
    }
    words = {
        "filled": f"filler value {facts.filler or 0.0:.6g} in",
        "repeating": "copies of earlier stretches",
        "spiking": f"{facts.n_spikes} spikes",
    }
    remarks = [
        f"{words.get(kind, kind)} {100 * shares[kind]:.3g} %" if kind in shares else words.get(kind, kind)
        for kind in facts.faults
    ]
    return ", ".join(remarks + [f"missing {100 * facts.missing:.3g} %"] * (facts.missing > 0))
