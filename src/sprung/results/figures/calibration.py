"""Figures of a calibration: misfit by frequency before and after, learnt numbers against given ones."""

import numpy as np
from matplotlib.figure import Figure

from sprung.calibration import Calibration
from sprung.results.figures.style import FAINT, HALF_WIDTH_95, INK, MODE_COLOURS, NORMAL, SMALL, new_figure, plain

#: Groups whose numbers are drawn where they are identifiable.
_DRAWN = 40


def misfit_figure(calibration: Calibration, *, source: str = "") -> Figure:
    """Draw the misfit of each coordinate by frequency, with the vehicle file as given and as completed.

    Parameters
    ----------
    calibration
        Vehicle completed from drives.
    source
        Name of the recordings, for the heading.

    Examples
    --------
    A misfit of 50 % with the file as given, and of 10 % as completed:

    >>> import numpy as np
    >>> from sprung.calibration import CalibratedNumber, Calibration
    >>> from sprung.vehicles import read_vehicle
    >>> place = CalibratedNumber("acc_fl.x", "sensors", "m", 1.22, 1.3, 0.01, 0.1, is_identifiable=True)
    >>> vehicle, f, misfit = read_vehicle("zafira"), np.linspace(1, 20, 39), np.full((1, 39), 0.5)
    >>> misfits = {"misfit_before": misfit, "misfit_after": misfit / 5}
    >>> errors = {"model_errors_before": (0.3,), "model_errors_after": (0.04,), "evidence_gain": 120.0}
    >>> rest = {**misfits, **errors, "n_segments": (200,), "notes": ()}
    >>> calibration = Calibration(vehicle, (place,), ("bounce",), f, **rest)
    >>> before, after = (line.get_ydata() for line in misfit_figure(calibration).axes[0].lines[:2])
    >>> float(before[0]), float(after[0])
    (50.0, 10.0)
    """
    names = calibration.coordinates
    what = f"Misfit before and after calibration: {source}" if source else "Misfit before and after calibration"
    n_segments = sum(calibration.n_segments)
    where = f"measured over fitted power, minus 1: {calibration.n_windows} windows, {n_segments} segments"
    figure = new_figure(what, where, width=9.5, height=1.3 + 1.9 * len(names))
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    chance = HALF_WIDTH_95 * np.sqrt(1.06 / n_segments)
    for row, (name, axes) in enumerate(zip(names, panels, strict=True)):
        plain(axes)
        axes.axhspan(-100 * chance, 100 * chance, color="#E6E6E6", label="95 % range of chance")
        for misfit, colour, label in (
            (calibration.misfit_before, FAINT, "as given"),
            (calibration.misfit_after, MODE_COLOURS[0], "calibrated"),
        ):
            axes.plot(calibration.frequencies, 100 * misfit[row], color=colour, label=label, linewidth=1.2)
        axes.axhline(0, color=INK, linewidth=0.8)
        axes.set_ylabel(f"{name}\n[%]", fontsize=SMALL)
    panels[0].legend(fontsize=SMALL, frameon=False, ncols=3)
    panels[-1].set_xlabel("Frequency [Hz]", fontsize=NORMAL)
    return figure


def learnt_figure(calibration: Calibration, *, source: str = "") -> Figure:
    """Draw how far the numbers that the drives determine are from the given ones, in prior standard deviations.

    Parameters
    ----------
    calibration, source
        As for `misfit_figure`.

    Examples
    --------
    A sensor is 0.08 m ahead of its place in the file:

    >>> import numpy as np
    >>> from sprung.calibration import CalibratedNumber, Calibration
    >>> from sprung.vehicles import read_vehicle
    >>> place = CalibratedNumber("acc_fl.x", "sensors", "m", 1.22, 1.3, 0.01, 0.1, is_identifiable=True)
    >>> vehicle, f, misfit = read_vehicle("zafira"), np.linspace(1, 20, 39), np.full((1, 39), 0.5)
    >>> misfits = {"misfit_before": misfit, "misfit_after": misfit / 5}
    >>> errors = {"model_errors_before": (0.3,), "model_errors_after": (0.04,), "evidence_gain": 120.0}
    >>> rest = {**misfits, **errors, "n_segments": (200,), "notes": ()}
    >>> calibration = Calibration(vehicle, (place,), ("bounce",), f, **rest)
    >>> [label.get_text() for label in learnt_figure(calibration).axes[0].get_yticklabels()]
    ['acc_fl.x']
    """
    numbers = [number for number in calibration.learnt if number.is_identifiable and number.nominal_value is not None][:_DRAWN]
    what = f"Learnt numbers against the vehicle file: {source}" if source else "Learnt numbers against the vehicle file"
    where = "in usual standard deviations, with 95 % intervals"
    figure = new_figure(what, where, width=7.5, height=1.5 + 0.22 * max(len(numbers), 4))
    axes = figure.subplots()
    plain(axes)
    axes.axvline(0, color=INK, linewidth=0.8)
    for row, number in enumerate(numbers):
        centre = (number.value - (number.nominal_value or 0.0)) / number.prior_std
        reach = HALF_WIDTH_95 * number.std / number.prior_std
        axes.hlines(row, centre - reach, centre + reach, color=MODE_COLOURS[0], linewidth=1.5)
        axes.plot(centre, row, "o", color=MODE_COLOURS[0], markersize=4)
    axes.set_yticks(range(len(numbers)), [number.name for number in numbers], fontsize=SMALL)
    axes.invert_yaxis()
    axes.set_xlabel("(learnt - given) / usual deviation [-]", fontsize=NORMAL)
    return figure
