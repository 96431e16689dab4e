"""Bounce tests as tables and sentences."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sprung._display import counted
from sprung.bounce_tests import Bounce
from sprung.results.tables.identification import shapes_in_words
from sprung.results.tables.table import Table, in_words, with_deviation

_UNITS = {"spring": "N/m", "damper": "N s/m", "tyre": "N/m"}
_QUANTITIES = {"natural_frequency": "frequency", "damping_ratio": "damping", "value": "value"}


def bounce_in_words(bounce: Bounce) -> str:
    """Return the number of tests and modes, and the largest change, in a line."""
    sizes = f"{counted(len(bounce.tests), 'test')}, {counted(len(bounce.modes), 'mode')}"
    if not bounce.changes:
        return sizes
    significant = [change for change in bounce.changes if change.is_significant]
    if not significant:
        return f"{sizes}; no change detected"
    largest = max(significant, key=lambda change: change.score)
    what = f"{in_words(largest.part)} {_QUANTITIES[largest.quantity]}".removesuffix(" value")
    return f"{sizes}; changed: {what} {100 * largest.change:+.0f} %"


def bounce_tables(bounce: Bounce) -> list[Table]:
    """Return the modes of all tests, the single tests, springs and dampers, and changes as tables."""
    tables = [_modes_table(bounce), _tests_table(bounce)]
    known = [value for value in bounce.corners if value.is_identifiable]
    if known:
        rows = tuple(
            (
                in_words(value.component.corner),
                f"{value.component.kind} [{_UNITS[value.component.kind]}]",
                with_deviation(value.value, value.value * value.std),
                f"{100 * (value.value / value.nominal - 1):+.1f}",
            )
            for value in known
        )
        columns = ("corner", "component", "value", "from nominal [%]")
        tables.append(Table("Corners", columns, rows, n_words=2, caption="± standard deviation"))
    if bounce.changes:
        changes = tuple(
            (
                in_words(change.part),
                _QUANTITIES[change.quantity],
                f"{100 * change.change:+.1f}",
                f"{100 * change.interval[0]:+.0f} .. {100 * change.interval[1]:+.0f}",
                "changed" if change.is_significant else "no change detected",
            )
            for change in bounce.changes
        )
        headings = ("part", "quantity", "change [%]", "95 % [%]", "verdict")
        tables.append(Table("Changes since the test before", headings, changes, n_words=2))
    return tables


def _modes_table(bounce: Bounce) -> Table:
    """Return the modes of all tests together."""
    modes = bounce.modes
    shapes = shapes_in_words(modes.channels, modes.mode_shapes)
    rows = tuple(
        (
            with_deviation(modes.natural_frequency[k], modes.natural_frequency_std[k]),
            with_deviation(100 * modes.damping_ratio[k], 100 * modes.damping_ratio_std[k]),
            in_words(modes.labels[k] or ""),
            shapes[k],
        )
        for k in range(len(modes))
    )
    columns = ("frequency [Hz]", "damping [%]", "label", "shape")
    return Table("Modes", columns, rows, n_words=0, caption="± standard deviation")


def _tests_table(bounce: Bounce) -> Table:
    """Return the modes of each test, with friction where it is stated apart."""
    rows = []
    for number, test in enumerate(bounce.tests, start=1):
        modes = test.modes
        for k, fit in enumerate(test.frictions):
            friction = ("", "")
            if fit is not None and fit.is_significant:
                sticking = float(np.max(fit.sticking))
                viscous = with_deviation(100 * fit.damping_ratio, 100 * fit.damping_ratio_std)
                friction = viscous, with_deviation(sticking, sticking * fit.friction_std / fit.friction)
            rows.append(
                (
                    str(number) if k == 0 else "",
                    f"{test.transient.onset:.1f}" if k == 0 else "",
                    with_deviation(modes.natural_frequency[k], modes.natural_frequency_std[k]),
                    with_deviation(100 * modes.damping_ratio[k], 100 * modes.damping_ratio_std[k]),
                    *friction,
                    f"{100 * test.residual:.1f}" if k == 0 else "",
                )
            )
    columns = ("test", "at [s]", "frequency [Hz]", "damping [%]", "viscous [%]", "sticks below", "left [%]")
    caption = "damping: with friction, of equal energy; sticks below: in the unit of travel; left: RMS not explained"
    return Table("Tests", columns, tuple(rows), n_words=0, caption=caption)


def bounce_columns(bounce: Bounce) -> Mapping[str, Any]:
    """Return the columns of the modes of bounce tests."""
    modes = bounce.modes
    return {
        "natural_frequency [Hz]": modes.natural_frequency,
        "natural_frequency_std [Hz]": modes.natural_frequency_std,
        "damping_ratio [-]": modes.damping_ratio,
        "damping_ratio_std [-]": modes.damping_ratio_std,
        "label": modes.labels,
    }


def bounce_parts(bounce: Bounce) -> list[Any]:
    """Return the tables and sentences of bounce tests."""
    return [bounce_in_words(bounce), *bounce_tables(bounce), bounce.notes]
