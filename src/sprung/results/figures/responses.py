"""Frequency responses and cepstra."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sprung._arrays import Complex, Real
from sprung.results.figures.style import INK, MODE_COLOURS, NORMAL, SMALL, new_figure, plain


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
    figure = new_figure(title, "", width=9.5, height=5.5 if has_phase else 3.8)
    panels = figure.subplots(2 if has_phase else 1, 1, sharex=True, squeeze=False)[:, 0]
    for number, (name, values) in enumerate(responses):
        colour = MODE_COLOURS[number % len(MODE_COLOURS)]
        panels[0].semilogy(frequencies, np.abs(values), color=colour, label=name, linewidth=1.3)
        if has_phase:
            panels[1].plot(frequencies, np.degrees(np.unwrap(np.angle(values))), color=colour, linewidth=1.3)
    for axes in panels:
        plain(axes)
        for _, frequency in marked:
            axes.axvline(frequency, color="#888888", linewidth=0.8, linestyle=":")
    for name, frequency in marked:
        panels[0].annotate(
            f"{name} {frequency:.2f} Hz",
            (frequency, 0.02),
            xycoords=("data", "axes fraction"),
            rotation=90,
            fontsize=SMALL,
            ha="right",
            va="bottom",
            color="#555555",
        )
    panels[0].set_ylabel(f"Magnitude [{unit}]", fontsize=NORMAL)
    if has_phase:
        panels[1].set_ylabel("Phase [degrees]", fontsize=NORMAL)
    panels[-1].set_xlabel("Frequency [Hz]", fontsize=NORMAL)
    panels[-1].set_xlim(frequencies[0], frequencies[-1])
    if len(responses) > 1:
        panels[0].legend(fontsize=SMALL, frameon=False)
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
    figure = new_figure(title, "", width=9.5, height=4.2)
    panels = figure.subplots(2, 1, sharex=True)
    limit = 1.3 * np.abs(cepstrum[quefrencies > 0.02]).max()
    for axes, values, name in ((panels[0], cepstrum, "raw"), (panels[1], cepstrum * lifter, "edited")):
        plain(axes)
        axes.plot(quefrencies, values, color=MODE_COLOURS[0], linewidth=0.8)
        axes.plot(quefrencies, limit * 0.9 * lifter, color=INK, linewidth=1.2, linestyle="--")
        axes.set_ylim(-limit, limit)
        axes.set_ylabel(f"{name} [-]", fontsize=NORMAL)
        if pulse_period is not None:
            for number in range(1, int(quefrencies[-1] / pulse_period) + 1):
                axes.axvline(number * pulse_period, color=MODE_COLOURS[1], linewidth=0.8, linestyle=":")
    dotted = "" if pulse_period is None else "; dotted: rahmonics of the pulses"
    panels[1].set_xlabel(f"Quefrency [s]; dashed: lifter{dotted}", fontsize=NORMAL)
    return figure
