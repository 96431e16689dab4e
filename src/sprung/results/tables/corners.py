"""Tables of a fit of springs, dampers and tyres."""

from sprung.likelihood import CornerFit
from sprung.results.tables.table import Table, in_words, with_deviation

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
