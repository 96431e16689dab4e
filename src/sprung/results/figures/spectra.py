"""Spectra of the channels before and after cepstrum editing, frequency responses and cepstra."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sprung._arrays import Complex, Real
from sprung.identification import Identification
from sprung.results.figures import draw
from sprung.results.figures.frequency_axis import (
    FrequencyRange,
    curve_limits,
    frequency_range,
    harmonic_handles,
    head_room,
    mark_harmonics,
    mark_modes,
)
from sprung.results.figures.style import STYLE, mode_colour, origin, pretty_unit
from sprung.signals.spectrum import SpectralMatrix


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
