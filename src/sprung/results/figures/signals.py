"""Recordings over time and frequency, spectra and their lines, and the spread of a quantity over many runs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.signal import ShortTimeFFT
from scipy.signal.windows import hann

from sprung._arrays import Complex, Real
from sprung.identification import Identification
from sprung.recording import Recording
from sprung.results.figures import draw
from sprung.results.figures.draw import STYLE, mode_colour, origin, pretty_unit, with_unit
from sprung.results.figures.frequency_axis import (
    FrequencyRange,
    curve_limits,
    frequency_range,
    harmonic_handles,
    head_room,
    mark_harmonics,
    mark_modes,
)
from sprung.signals.data_faults import is_condition
from sprung.signals.spectrum import SpectralMatrix, spectral_matrix


def spectra_figure(identification: Identification, *, source: str = "") -> Figure:
    """Draw the power spectral density of each channel, before and after cepstrum editing, with harmonics and modes.

    Parameters
    ----------
    identification
        Identification; without cepstrum editing there is one curve for each channel.
    source
        Name of the recording, for the heading.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with a panel for each of the first 24 channels; harmonics are marked in the channels that show them.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> figure = spectra_figure(identification)
    >>> len(figure.axes), figure.axes[-1].get_xlabel()
    (3, 'Frequency [Hz]')
    """
    n_channels = min(len(identification.channels), STYLE.max_channels)
    n_rows, n_columns = draw.panel_grid(n_channels, max_columns=1 if n_channels <= 4 else 2 if n_channels <= 10 else 3)
    what = "Power spectral densities"
    if identification.edited_spectra is not None:
        what += " before and after cepstrum editing"
    if n_channels < len(identification.channels):
        what += f" of the first {n_channels} of {len(identification.channels)} channels"
    row_height = 3.4 if n_rows == 1 else 2.1
    labels = STYLE.labelled * bool(identification.harmonics)
    size: dict[str, float] = {"width": STYLE.wide, "height": 2.0 + row_height * (n_rows + labels)}
    figure = draw.new_figure(what, origin(identification), source=source, **size)
    heights = [1.0 + labels] + [1.0] * (n_rows - 1)
    panels = draw.panels(figure, n_rows, n_columns, n_used=n_channels, sharex=True, height_ratios=heights)
    shown = frequency_range(identification)
    width = 0.9 * STYLE.wide / n_columns
    for k, axes in enumerate(panels.flat[:n_channels]):
        shown.put_on(axes)
        has_labels = k < n_columns
        name = identification.channels[k].name
        room = head_room(identification.harmonics if has_labels else (), row_height)
        _draw_channel(axes, identification, k, shown, room)
        mark_harmonics(axes, identification.harmonics, width=width, channel=name, has_labels=has_labels)
        style: dict[str, Any] = {"has_labels": has_labels, "is_short": n_columns > 1}
        mark_modes(axes, identification.modes, width=width, height=0.8 * row_height, **style)
        axes.set_ylabel(f"{name}\n{_level_unit(identification.channels[k].unit)}", fontsize=STYLE.small)
        if k + n_columns >= n_channels:
            axes.set_xlabel("Frequency [Hz]")
            axes.tick_params(labelbottom=True)
    draw.legend(figure, _legend(identification), n_columns=4)
    return figure


def _level_unit(unit: str) -> str:
    """Return the unit of the level of a power spectral density, such as "[dB re 1 (m/s²)²/Hz]"."""
    if not unit:
        return "[dB], as recorded"
    density = f"({pretty_unit(unit)})²/Hz" if set(unit) & set("/^") else f"{pretty_unit(unit)}²/Hz"
    return f"[dB re 1 {density}]"


def _draw_channel(axes: Axes, identification: Identification, row: int, shown: FrequencyRange, room: float) -> None:
    """Draw the curves of one channel and leave room above them for labels."""
    before, after = identification.spectra, identification.edited_spectra
    curves = [(after or before, STYLE.ink, 1.3, "spectrum")]
    if after is not None:
        curves.insert(0, (before, STYLE.faint, 0.9, "spectrum before editing"))
    levels = []
    for spectra, colour, width, gid in curves:
        level = _decibels(spectra, row)
        axes.plot(spectra.frequencies[1:], level[1:], color=colour, linewidth=width, gid=gid, zorder=2)
        levels.append(level[shown.holds(spectra.frequencies)])
    axes.set_ylim(curve_limits(np.concatenate(levels), dynamic_range=STYLE.spectrum_span, room=room))


def _decibels(spectra: SpectralMatrix, row: int) -> Real:
    """Return the density of a channel [dB]."""
    return 10 * np.log10(np.maximum(spectra.matrix[row, row].real, 1e-30))


def _legend(identification: Identification) -> list[Line2D | Patch]:
    """Return a legend entry for each kind of line."""
    name, before = "power spectral density", []
    if identification.edited_spectra is not None:
        name, before = (
            f"{name} after cepstrum editing",
            [draw.entry("before editing", color=STYLE.faint, linewidth=0.9)],
        )
    every = {channel.name for channel in identification.channels}
    is_partial = any(set(line.channels) != every for line in identification.harmonics)
    faint = [draw.entry("(faint: not in this channel)", linestyle="none")] if is_partial else []
    after = draw.entry(name, color=STYLE.ink, linewidth=1.3)
    return [*before, after, *harmonic_handles(identification.harmonics), *faint]


def response_figure(
    frequencies: Real,
    responses: Sequence[tuple[str, Complex]],
    *,
    title: str,
    unit: str,
    marked: Sequence[tuple[str, float]] = (),
    has_phase: bool = False,
) -> Figure:
    """Draw the magnitude of frequency responses, and optionally their phase.

    Parameters
    ----------
    frequencies
        Frequencies [Hz], shape (frequencies,).
    responses
        Names and frequency responses, shape (frequencies,) each.
    title
        Heading of the figure.
    unit
        Unit of the magnitude.
    marked
        Names and frequencies [Hz] of vertical lines.
    has_phase
        Whether to draw the phase.

    Examples
    --------
    A low-pass with its corner at 2 Hz, where the magnitude is 1 / √2 and the phase -45°:

    >>> import numpy as np
    >>> f = np.arange(50) / 5
    >>> figure = response_figure(f, [("low-pass", 1 / (1 + 0.5j * f))], title="Filter", unit="-", has_phase=True)
    >>> magnitude, phase = (axes.lines[0].get_ydata() for axes in figure.axes)
    >>> round(float(magnitude[10]), 3), round(float(phase[10]), 1)
    (0.707, -45.0)
    """
    figure = draw.new_figure(title, height=5.5 if has_phase else 3.8)
    panels = draw.panels(figure, 1 + has_phase, sharex=True)[:, 0]
    for number, (name, values) in enumerate(responses):
        style: dict[str, Any] = {"color": mode_colour(number), "linewidth": 1.3}
        panels[0].semilogy(frequencies, np.abs(values), label=name, **style)
        if has_phase:
            panels[1].plot(frequencies, np.degrees(np.unwrap(np.angle(values))), **style)
            panels[1].set_ylabel("Phase [degrees]")
    for axes in panels:
        named = [(f"{name} {frequency:.2f} Hz" if axes is panels[0] else "", frequency) for name, frequency in marked]
        draw.mark_frequencies(axes, named, height=0.02)
    panels[0].set_ylabel(f"Magnitude [{unit}]")
    panels[-1].set(xlabel="Frequency [Hz]", xlim=(frequencies[0], frequencies[-1]))
    if len(responses) > 1:
        draw.legend(panels[0])
    return figure


def cepstrum_figure(
    quefrencies: Real,
    cepstrum: Real,
    lifter: Real,
    *,
    title: str,
    pulse_period: float | None = None,
) -> Figure:
    """Draw a cepstrum before and after editing, with the lifter.

    Parameters
    ----------
    quefrencies
        Quefrencies [s], shape (quefrencies,).
    cepstrum, lifter
        Cepstrum and weights of the lifter at the quefrencies, shape (quefrencies,).
    title
        Heading of the figure.
    pulse_period
        Period of a pulse train [s], whose rahmonics are marked; None: none.

    Examples
    --------
    >>> import numpy as np
    >>> quefrencies = np.arange(100) / 100
    >>> lifter = np.where(quefrencies < 0.25, 1.0, 0.0)
    >>> figure = cepstrum_figure(quefrencies, np.ones(100), lifter, title="Pulses", pulse_period=0.3)
    >>> bool(np.array_equal(figure.axes[1].lines[0].get_ydata(), lifter))
    True
    """
    figure = draw.new_figure(title, height=4.2)
    panels = draw.panels(figure, 2, sharex=True)[:, 0]
    limit = 1.3 * np.abs(cepstrum[quefrencies > 0.02]).max()
    for axes, values, name in ((panels[0], cepstrum, "raw"), (panels[1], cepstrum * lifter, "edited")):
        axes.plot(quefrencies, values, color=STYLE.colours[0], linewidth=0.8)
        axes.plot(quefrencies, limit * 0.9 * lifter, color=STYLE.ink, linewidth=1.2, linestyle="--")
        axes.set(ylim=(-limit, limit), ylabel=f"{name} [-]")
        if pulse_period is not None:
            for number in range(1, int(quefrencies[-1] / pulse_period) + 1):
                axes.axvline(number * pulse_period, color=STYLE.colours[1], linewidth=0.8, linestyle=":")
    dotted = "" if pulse_period is None else "; dotted: rahmonics of the pulses"
    panels[1].set_xlabel(f"Quefrency [s]; dashed: lifter{dotted}")
    return figure


def histories_figure(recordings: Sequence[tuple[str, Recording]], *, title: str, window: float | None = None) -> Figure:
    """Draw every channel over time, one panel for each, one curve for each recording.

    Parameters
    ----------
    recordings
        Names in the legend and recordings, all with the channels of the first; the largest recording first.
    title
        Heading of the figure.
    window
        Length shown [s]; None: all. Long records are drawn by the largest and smallest value in each of 2000 intervals.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> axes = histories_figure([("run", run)], title="A tone", window=2.0).axes[0]
    >>> axes.get_ylabel(), round(float(axes.lines[0].get_xdata()[-1]), 2)
    ('acceleration [m/s²]', 1.99)
    """

    def curve(axes: Axes, row: int, recording: Recording, style: dict[str, Any]) -> None:
        rate = recording.sampling_rate
        shown = recording.n_samples if window is None else min(recording.n_samples, round(window * rate))
        time, values = _envelope(np.arange(shown) / rate, recording.samples[row, :shown])
        axes.plot(time, values, **style, linewidth=0.7)

    figure = _channels_figure(recordings, curve, title=title, axis="Time [s]")
    for axes, channel in zip(figure.axes, recordings[0][1].channels, strict=False):
        quantity = "value" if channel.quantity == "unknown" else channel.quantity.replace("_", " ")
        axes.set_ylabel(with_unit(quantity, channel.unit))
    return figure


def levels_figure(recordings: Sequence[tuple[str, Recording]], *, title: str, interval: float = 2.0) -> Figure:
    """Draw the RMS of every channel in intervals of time; parameters as for `histories_figure`, interval in s.

    Examples
    --------
    A tone with an RMS of 3 m/s²:

    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> levels = levels_figure([("run", run)], title="A tone").axes[0].lines[0].get_ydata()
    >>> len(levels), float(levels[0].round(6))
    (20, 3.0)
    """

    def curve(axes: Axes, row: int, recording: Recording, style: dict[str, Any]) -> None:
        per = round(interval * recording.sampling_rate)
        blocks = recording.samples[row, : recording.n_samples // per * per].reshape(-1, per)
        times = (np.arange(len(blocks)) + 0.5) * interval
        axes.plot(times, np.sqrt(np.mean(blocks**2, axis=1)), **style, marker=".", linewidth=1)

    figure = _channels_figure(recordings, curve, title=title, axis="Time [s]")
    for axes, channel in zip(figure.axes, recordings[0][1].channels, strict=False):
        axes.set(ylim=(0, None), ylabel=with_unit("RMS", channel.unit))
    return figure


def densities_figure(
    recordings: Sequence[tuple[str, Recording]],
    *,
    title: str,
    highest: float,
    lowest: float = 0.0,
    segment: float = 4.0,
    marked: Sequence[tuple[str, float]] = (),
) -> Figure:
    """Draw the power spectral density of every channel.

    Parameters
    ----------
    recordings
        Names in the legend and recordings, all with the channels of the first.
    title
        Heading of the figure.
    highest, lowest
        Range of frequencies [Hz].
    segment
        Length of the averaged segments [s].
    marked
        Names and frequencies [Hz] of vertical lines.

    Examples
    --------
    The area below the density is the mean square, 9 (m/s²)²:

    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> line = densities_figure([("run", run)], title="A tone", highest=50.0).axes[0].lines[0]
    >>> frequency, density = line.get_xdata(), line.get_ydata()
    >>> round(float(density.sum() * (frequency[1] - frequency[0])), 2)
    9.0
    """
    spectra = {id(recording): spectral_matrix(recording, segment_length=segment) for _, recording in recordings}

    def curve(axes: Axes, row: int, recording: Recording, style: dict[str, Any]) -> None:
        one = spectra[id(recording)]
        shown = (one.frequencies >= max(lowest, 1 / segment)) & (one.frequencies <= highest)
        axes.semilogy(one.frequencies[shown], np.maximum(one.densities[row, shown], 1e-30), **style, linewidth=1)

    figure = _channels_figure(recordings, curve, title=title, axis="Frequency [Hz]")
    for axes, channel in zip(figure.axes, recordings[0][1].channels, strict=False):
        is_first = axes is figure.axes[0]
        draw.mark_frequencies(axes, [(name * is_first, frequency) for name, frequency in marked], height=1.0)
        axes.set_xlim(lowest, highest)
        axes.set_ylabel(with_unit("PSD", channel.unit and f"({channel.unit})^2/Hz"))
    return figure


def spectrogram_figure(recording: Recording, *, title: str, highest: float, segment: float = 4.0) -> Figure:
    """Draw the power spectral density of every channel over time and frequency.

    Parameters
    ----------
    recording
        Recording; missing values count as the mean.
    title
        Heading of the figure.
    highest
        Highest frequency [Hz].
    segment
        Length of the segments [s]; shorter where the recording has fewer than eight of them.

    Notes
    -----
    The colours cover the upper 60 dB of each channel.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> axes = spectrogram_figure(run, title="A tone", highest=50.0).axes[0]
    >>> axes.get_ylabel(), axes.get_xlabel()
    ('Frequency [Hz]', 'Time [s]')
    """
    rate = recording.sampling_rate
    n_segment = max(16, min(round(segment * rate), recording.n_samples // 8))
    hop = max(n_segment // 2, recording.n_samples // STYLE.max_columns)
    transform = ShortTimeFFT(hann(n_segment, sym=False), hop, rate, scale_to="psd", fft_mode="onesided2X")

    def curve(axes: Axes, row: int, one: Recording, style: dict[str, Any]) -> None:
        values = one.samples[row] - np.nanmean(one.samples[row]) if np.isfinite(one.samples[row]).any() else 0.0
        power = transform.spectrogram(np.nan_to_num(values * np.ones(one.n_samples)))
        shown = (transform.f > 0) & (transform.f <= highest)
        level = 10 * np.log10(np.maximum(power[shown], 1e-300))
        times, top = transform.t(one.n_samples), float(level.max())
        axes.pcolormesh(times, transform.f[shown], level, vmin=top - 60, vmax=top, cmap="cividis", rasterized=True)
        axes.set_xlim(0, one.duration)

    figure = _channels_figure([("", recording)], curve, title=title, axis="Time [s]")
    for axes in figure.axes[: len(recording.channels)]:
        axes.set_ylabel("Frequency [Hz]")
    return figure


def overview_figures(recording: Recording, *, source: str) -> dict[str, Figure]:
    """Return the first figures that anybody wants of a recording: signals, spectra and spectrograms, by name.

    Spectra are those of the channels of motion with values, missing ones taken as their mean; records of fewer than
    `STYLE.min_spectrum` samples without a gap have none.
    """
    figures = {"signals": histories_figure([("", recording)], title=f"Signals of {source}")}
    moving = [
        channel.name
        for channel, values in zip(recording.channels, recording.samples, strict=True)
        if np.isfinite(values).any() and not is_condition(channel.name, channel.quantity)
    ]
    longest = max((stretch.stop - stretch.start for stretch in recording.stretches()), default=0)
    if not moving or longest < STYLE.min_spectrum:
        return figures
    motion = recording.select(moving)
    known = np.where(np.isfinite(motion.samples), motion.samples, np.nan)
    motion = replace(motion, samples=np.where(np.isnan(known), np.nanmean(known, axis=1, keepdims=True), known))
    highest, segment = recording.sampling_rate / 2, min(4.0, longest / 8 / recording.sampling_rate)
    title = f"Spectra of {source}"
    figures["spectra"] = densities_figure([("", motion)], title=title, highest=highest, segment=segment)
    title = f"Spectrograms of {source}, upper 60 dB"
    figures["spectrograms"] = spectrogram_figure(motion, title=title, highest=highest)
    return figures


def _channels_figure(
    recordings: Sequence[tuple[str, Recording]],
    curve: Callable[[Axes, int, Recording, dict[str, Any]], None],
    *,
    title: str,
    axis: str,
) -> Figure:
    """Return a figure with a panel for each channel of the first recording, one below another; two columns for many."""
    channels = recordings[0][1].channels
    n_rows, n_columns = draw.panel_grid(len(channels), max_columns=1 if len(channels) <= 3 else 2)
    figure = draw.new_figure(title, height=1.1 + 1.75 * n_rows)
    panels = draw.panels(figure, n_rows, n_columns, n_used=len(channels), size=STYLE.small, sharex=True).ravel()
    for row, (axes, channel) in enumerate(zip(panels, channels, strict=False)):
        for number, (_, recording) in enumerate(recordings):
            curve(axes, row, recording, {"color": mode_colour(number)})
        draw.title(axes, channel.name)
        if row >= len(channels) - n_columns:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel(axis, fontsize=STYLE.normal)
    if len(recordings) > 1:
        handles, names = panels[0].lines[: len(recordings)], [name for name, _ in recordings]
        draw.legend(figure, handles, labels=names, n_columns=4)
    return figure


def _envelope(time: Real, values: Real) -> tuple[Real, Real]:
    """Return the largest and smallest value of each interval if there are too many samples to draw."""
    per = -(-values.size * 2 // STYLE.max_points)
    if per <= 2:
        return time, values
    blocks = values[: values.size // per * per].reshape(-1, per)
    middle = time[: values.size // per * per].reshape(-1, per).mean(axis=1)
    return np.repeat(middle, 2), np.stack([blocks.min(axis=1), blocks.max(axis=1)], axis=1).ravel()


def recording_figure(recording: Recording) -> Figure:
    """Return the signals of a recording over time."""
    return histories_figure([("", recording)], title="Signals")


@dataclass(frozen=True, eq=False, slots=True)
class Spread:
    """One quantity in many runs of several methods.

    Parameters
    ----------
    name
        Name of the quantity, with its unit.
    rows
        Names of the methods.
    values
        Values, shape (rows, runs); NaN where a run has none.
    truth
        True value; NaN if unknown.
    published
        Published value of each row; NaN without one.
    """

    name: str
    rows: tuple[str, ...]
    values: Real
    truth: float
    published: tuple[float, ...] = ()


def runs_figure(spreads: Sequence[Spread], *, title: str) -> Figure:
    """Draw every run as a point, a panel for each quantity, a row for each method.

    Parameters
    ----------
    spreads
        Quantities, at least one.
    title
        Heading of the figure.

    Examples
    --------
    Three runs, of which one did not find the mode:

    >>> import numpy as np
    >>> from sprung.results.figures import Spread
    >>> values = np.array([[1.48, 1.52, np.nan]])
    >>> figure = runs_figure([Spread("f [Hz]", ("Cov-SSI",), values, 1.5, (1.5,))], title="Bounce")
    >>> [text.get_text() for text in figure.axes[0].texts]
    ['2 of 3']
    """
    n_rows, n_columns = draw.panel_grid(len(spreads), max_columns=3)
    longest = max(len(name) for spread in spreads for name in spread.rows)
    where = "Points: runs. Bar: median. Line: true value. Diamond: published."
    figure = draw.new_figure(title, where, height=1.3 + n_rows * (0.9 + 0.33 * len(spreads[0].rows)))
    panels = draw.panels(figure, n_rows, n_columns, n_used=len(spreads), sharey=longest > 0).ravel()
    for axes, spread in zip(panels, spreads, strict=False):
        _draw(axes, spread)
    return figure


def _draw(axes: Axes, spread: Spread) -> None:
    for row, values in enumerate(spread.values):
        finite = values[np.isfinite(values)]
        offsets = 0.22 * np.sin(np.arange(finite.size) * 2.399)  # the golden angle spreads them evenly
        axes.plot(finite, row + offsets, ".", color=STYLE.colours[0], markersize=3, alpha=0.5)
        if finite.size:
            axes.plot([np.median(finite)] * 2, [row - 0.35, row + 0.35], color=STYLE.ink, linewidth=1.5)
        remark = f"{finite.size} of {values.size}"
        axes.annotate(
            remark, (0.995, row), xycoords=("axes fraction", "data"), fontsize=STYLE.small, ha="right", va="center"
        )
        if row < len(spread.published) and np.isfinite(spread.published[row]):
            axes.plot(spread.published[row], row, "D", color=STYLE.colours[1], markersize=5)
    if np.isfinite(spread.truth):
        axes.axvline(spread.truth, color=STYLE.colours[2], linewidth=1)
    low, high = axes.get_xlim()
    axes.set_xlim(low, high + 0.25 * (high - low))
    axes.set_yticks(range(len(spread.rows)), spread.rows, fontsize=STYLE.small)
    axes.set(ylim=(len(spread.rows) - 0.5, -0.5), xlabel=spread.name)
