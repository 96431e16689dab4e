"""Bounce tests: records, fits and envelopes."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sprung.bounce_tests import Bounce, BounceTest
from sprung.results.figures.style import INK, MODE_COLOURS, SMALL, new_figure, plain, with_unit

#: Most tests that are drawn, and most channels of each.
_MAX_TESTS, _MAX_CHANNELS = 6, 4


def bounce_figure(bounce: Bounce, *, source: str = "") -> Figure:
    """Draw the channels of each test over time, with the fitted motion, and the envelope of its slowest mode.

    Examples
    --------
    >>> import sprung
    >>> time = np.arange(300) / 100
    >>> swing = np.exp(-0.2 * 2 * np.pi * 1.5 * time) * np.sin(2 * np.pi * 1.5 * np.sqrt(1 - 0.2**2) * time)
    >>> rest = np.zeros(300)
    >>> motion = np.concatenate([rest, swing, rest]) + 0.01 * np.random.default_rng(1).standard_normal(900)
    >>> tests = sprung.bounce(sprung.Recording(motion[None], 100.0, (sprung.Channel("acc", "acceleration"),)))
    >>> len(bounce_figure(tests).axes)
    1
    """
    tests = bounce.tests[:_MAX_TESTS]
    n_channels = min(len(tests[0].part.channels), _MAX_CHANNELS)
    what = "Free motion after each push: record, fit and envelope"
    figure = new_figure(what, source, width=max(4.0 * len(tests), 7.0), height=1.6 + 1.9 * n_channels)
    grid = figure.subplots(n_channels, len(tests), squeeze=False, sharex="col")
    for column, test in enumerate(tests):
        for row in range(n_channels):
            _draw(grid[row, column], test, row)
        grid[0, column].set_title(f"test {column + 1}, at {test.transient.onset:.1f} s", fontsize=SMALL, loc="left")
        grid[-1, column].set_xlabel("Time [s]", fontsize=SMALL)
    for axes, channel in zip(grid[:, 0], tests[0].part.channels, strict=False):
        axes.set_ylabel(with_unit(channel.name, channel.unit), fontsize=SMALL)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower left", ncols=3, fontsize=SMALL, frameon=False)
    return figure


def _draw(axes: Axes, test: BounceTest, row: int) -> None:
    """Draw one channel of a test."""
    part, times = test.part, test.transient
    time = times.begin + np.arange(part.n_samples) / part.sampling_rate
    step = max(1, part.n_samples // 2000)
    axes.plot(time[::step], part.samples[row, ::step], color=INK, linewidth=0.8, label="record")
    fitted = test.fitted[row]
    axes.plot(time[::step], fitted[::step], color=MODE_COLOURS[0], linewidth=1.4, linestyle="--", label="fit")
    known = np.flatnonzero(np.isfinite(fitted))
    if known.size:
        middle = float(fitted[known[-1]])
        slowest = int(np.argmax(np.abs(test.modes.mode_shapes[:, row])))
        rate = test.modes.damping_ratio[slowest] * 2 * np.pi * test.modes.natural_frequency[slowest]
        largest = float(np.max(np.abs(fitted[known] - middle)))
        first = int(known[np.argmax(np.abs(fitted[known] - middle))])
        envelope = largest * np.exp(-rate * (time[first:] - time[first]))
        for side in (1, -1):
            label = "envelope" if side == 1 else None
            axes.plot(time[first:], middle + side * envelope, color=MODE_COLOURS[1], linewidth=0.8, label=label)
    plain(axes)
