"""MAC matrices of the modes, and between the subsets."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from sprung._arrays import Indices, Real
from sprung.identification import Identification
from sprung.modal import Modes, join_modes, mac
from sprung.results.figures.style import (
    INK,
    NO_MODE,
    NORMAL,
    SMALL,
    in_hertz,
    ink_on,
    mode_colour,
    mode_name,
    new_figure,
    origin,
    write_sentence,
)

#: Side of a cell [in], and up to how many modes the values are printed in them.
_CELL, _MOST_PRINTED = 0.52, 24


def mac_figure(identification: Identification, *, source: str = "") -> Figure:
    """Draw the modal assurance criterion between all modes and, with several subsets, between those of the subsets.

    Parameters
    ----------
    identification
        Identification with any number of modes.
    source
        Name of the recording, for the heading.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> (image,) = mac_figure(identification).axes[0].get_images()
    >>> image.get_array().shape, bool(np.allclose(np.diag(image.get_array()), 1))
    ((3, 3), True)
    """
    modes = identification.modes
    what = f"MAC of the mode shapes: {source}" if source else "MAC of the mode shapes"
    if not len(modes):
        return write_sentence(new_figure(what, origin(identification), width=8, height=3), NO_MODE)
    parts = [subset.modes for subset in identification.subsets]
    n_parts = sum(len(part) for part in parts)
    has_subsets = len(parts) > 1
    sides = [max(_CELL * n, 1.5) for n in ((len(modes), n_parts) if has_subsets else (len(modes),))]
    sides = [min(side, 9.0) for side in sides]
    figure = new_figure(
        what, origin(identification), width=max(sum(sides) + 2.2 * len(sides) + 0.8, 7.5), height=max(sides) + 2.6
    )
    panels = figure.subplots(1, len(sides), squeeze=False, width_ratios=sides)[0]
    for axes in panels:
        axes.set_anchor("N")
    names = [f"{mode_name(modes, k)}\n{in_hertz(modes.natural_frequency[k])}" for k in range(len(modes))]
    image = draw_mac(panels[0], mac(modes.mode_shapes, modes.mode_shapes), names)
    panels[0].set_title("between the modes", fontsize=NORMAL)
    _colour_ticks(panels[0], list(range(len(modes))))
    if has_subsets:
        _draw_subsets(panels[1], parts, identification.members)
    figure.colorbar(image, ax=list(panels), shrink=0.7, pad=0.02, panchor=False).set_label("MAC [-]", fontsize=NORMAL)
    return figure


def draw_mac(axes: Axes, values: Real, names: Sequence[str]) -> AxesImage:
    """Draw a MAC matrix with its values in the cells."""
    image = axes.imshow(values, cmap="Blues", vmin=0, vmax=1, gid="mac")
    n = len(values)
    axes.set_xticks(range(n), names, fontsize=SMALL, rotation=90)
    axes.set_yticks(range(n), names, fontsize=SMALL)
    axes.tick_params(length=0)
    if n <= _MOST_PRINTED:
        for (row, column), value in np.ndenumerate(values):
            colour = ink_on(image, value)
            axes.text(column, row, f"{value:.2f}", ha="center", va="center", fontsize=SMALL, color=colour, gid="value")
    return image


def _draw_subsets(axes: Axes, parts: Sequence[Modes], members: Indices) -> None:
    """Draw the MAC between the modes of all subsets, with lines between the subsets."""
    together = join_modes(parts)
    names, merged = [], []
    for k, part in enumerate(parts):
        for index, frequency in enumerate(part.natural_frequency):
            names.append(f"S{k + 1}  {in_hertz(frequency)}")
            matches = np.flatnonzero(members[:, k] == index)
            merged.append(int(matches[0]) if matches.size else None)
    draw_mac(axes, mac(together.mode_shapes, together.mode_shapes), names)
    for edge in np.cumsum([len(part) for part in parts])[:-1] - 0.5:
        axes.axhline(edge, color=INK, linewidth=1.5)
        axes.axvline(edge, color=INK, linewidth=1.5)
    axes.set_title("between the subsets (S1: lowest level; grey: not kept in merging)", fontsize=NORMAL)
    _colour_ticks(axes, merged)


def _colour_ticks(axes: Axes, modes: Sequence[int | None]) -> None:
    """Write the names in the modes' colours, grey for those in too few subsets to be a mode."""
    for labels in (axes.get_xticklabels(), axes.get_yticklabels()):
        for label, mode in zip(labels, modes, strict=True):
            label.set_color("#777777" if mode is None else mode_colour(mode))
            label.set_fontweight("bold")


def reference_mac_figure(parts: Sequence[tuple[str, Modes]], reference: Modes, *, title: str) -> Figure:
    """Draw the modal assurance criterion between identified and reference modes, a panel for each part.

    Parameters
    ----------
    parts
        Identified modes with the name of their origin, such as a subset.
    reference
        Reference modes of the same channels.
    title
        Heading of the figure.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> figure = reference_mac_figure([("run 1", identification.modes)], identification.modes, title="With itself")
    >>> (image,) = figure.axes[0].get_images()
    >>> bool(np.allclose(np.diag(image.get_array()), 1))
    True
    """
    width = max(7.5, 1.0 + sum(max(_CELL * len(modes), 1.2) + 1.2 for _, modes in parts))
    figure = new_figure(title, "", width=min(width, 12.0), height=1.9 + _CELL * len(reference))
    panels = figure.subplots(1, len(parts), squeeze=False)[0]
    names = [f"{mode_name(reference, k)}\n{in_hertz(reference.natural_frequency[k])}" for k in range(len(reference))]
    for axes, (name, modes) in zip(panels, parts, strict=True):
        axes.set_title(name, fontsize=NORMAL)
        if not len(modes):
            write_no_mode(axes)
            continue
        values = mac(reference.mode_shapes, modes.mode_shapes)
        image = axes.imshow(values, cmap="Blues", vmin=0, vmax=1, aspect="auto")
        axes.set_yticks(range(len(reference)), names, fontsize=SMALL)
        axes.set_xticks(
            range(len(modes)), [in_hertz(value) for value in modes.natural_frequency], fontsize=SMALL, rotation=30
        )
        axes.tick_params(length=0)
        for (row, column), value in np.ndenumerate(values):
            colour = ink_on(image, value)
            axes.text(column, row, f"{value:.2f}", ha="center", va="center", fontsize=SMALL, color=colour)
    return figure


def write_no_mode(axes: Axes) -> None:
    """Write into an empty panel that no mode was identified."""
    axes.set_axis_off()
    axes.text(0.5, 0.5, NO_MODE, ha="center", va="center", fontsize=SMALL, color=INK, transform=axes.transAxes)
