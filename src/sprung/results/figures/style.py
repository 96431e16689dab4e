"""Style common to all figures: colours, sizes, names and number formats."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sprung._arrays import Real
from sprung._display import listed
from sprung.identification import METHOD_NAMES, Identification
from sprung.modal import Modes


@dataclass(frozen=True, slots=True)
class Style:
    """Numbers of the figures: lengths in inches where nothing else is said."""

    # colours of modes by rising frequency (after Okabe and Ito: distinguishable for colour-blind readers)
    colours: tuple[str, ...] = (
        *("#0072B2", "#D55E00", "#009E73", "#C0609A"),
        *("#3FA0DC", "#7F4909", "#5B2C8A", "#8A8A00"),
    )
    ink: str = "#222222"  # of text and frames
    faint: str = "#8C8C8C"  # of secondary elements
    background: str = "#9FB4C7"  # of curves in the background
    harmonic: str = "#C08A00"  # of harmonics
    usual: str = "#E6E6E6"  # of the range of usual windows, or of chance
    attention: str = "#F3D9C9"  # of the time of an alert or an onset
    small: float = 8.0  # size of text [points]
    normal: float = 9.5
    large: float = 12.0
    kinds: tuple[str, ...] = ("spring", "damper", "tyre")  # in panels of their own
    no_mode: str = "No mode was identified."
    screen: int = 80  # resolution in notebooks and animations [dots per inch]
    file: int = 150  # resolution of saved figures [dots per inch]
    character: float = 0.6  # width of a character over the size of the font
    bold: float = 1.25  # width of bold text with a gap over that of plain text
    dark: float = 0.18  # relative luminance below which text on a colour is white
    dashes: tuple[int, tuple[int, int]] = (0, (4, 2))  # of harmonics
    # frequency axes
    wide: float = 11.0  # width of spectra and diagrams
    logarithmic_from: float = 12.0  # ratio of the upper end to the lowest mode
    below_lowest: float = 0.33  # start of a logarithmic axis over the lowest mode
    margin: float = 1.15  # shown on both sides of a band of interest
    passed: float = 0.8  # share of half the sampling rate up to which decimation passes everything
    min_level_span: float = 20.0  # smallest range of a level axis [dB]
    spectrum_span: float = 90.0  # levels of spectra are shown this far below their maximum [dB]
    diagram_span: float = 80.0  # so are those behind a diagram [dB]
    label_distance: float = 1.6  # smallest distance of two harmonics' labels over the size of their font
    clear: float = 0.012  # lines nearer to each other than this share of the axis fade
    leader: float = 0.22  # height of the line between an axis and the label of a mode
    labelled: float = 0.4  # additional height of a first row with labels of harmonics, of a row
    max_channels: int = 24  # in a figure of spectra
    max_points: int = 4000  # of a curve over time
    max_columns: int = 600  # of a spectrogram
    min_spectrum: int = 64  # samples of a record with spectra
    # mode shapes
    azimuth: float = -62.0  # of the view: from the right and slightly ahead [degrees]
    elevation: float = 24.0  # of the view: above the body [degrees]
    displacement: float = 0.28  # largest one, over the mean of the plate's length and width
    shortest_arrow: float = 0.05  # over the same mean
    two_lines: float = 0.15  # height of two lines of text, over the same mean
    max_texts: int = 6  # at the sensors of a plate
    many_channels: int = 12  # from more on, panels are wide
    max_ticks: int = 40  # on an axis of channels
    max_named: int = 6  # channels of a compass of many
    with_scales: float = 1.75  # upper end of an axis with the scales of several quantities
    frames: int = 24  # of one cycle of an animation
    frame_rate: int = 12  # of an animation [1/s]: a cycle takes two seconds
    animated: float = 0.14  # largest motion over the size of the structure
    max_nodes: int = 8  # nodes whose channels are named in an animation
    # values with intervals
    cell: float = 0.52  # side of a cell of a matrix
    max_printed: int = 24  # modes up to which the values of a matrix are printed
    min_correlation: float = 0.3  # smallest one that is printed
    max_numbers: int = 40  # of a vehicle file
    max_hypotheses: int = 8  # in a figure of evidence
    level_ranges: tuple[float, float] = (0.02, 0.2)  # smallest ranges of frequency and damping over levels, relative
    time_ranges: tuple[float, float] = (0.01, 0.3)  # and over time
    max_tracks: int = 12  # in panels of their own
    overview: float = 3.2  # height of all tracks together
    track: float = 1.35  # height of the panel of a track
    many_intervals: int = 60  # windows above which intervals are faint
    gap: float = 1.5  # distance of windows that breaks a curve, over that of neighbours
    many_windows: int = 200  # above which they are drawn in groups
    max_groups: int = 60
    group_hours: tuple[int, ...] = (1, 2, 3, 6, 12, 24, 48, 72, 168, 336, 720)  # lengths that groups may have [h]


STYLE = Style()


def mode_colour(index: int) -> str:
    """Return the colour of the mode at `index`, counted by rising frequency from 0."""
    return STYLE.colours[index % len(STYLE.colours)]


def mode_name(modes: Modes, index: int) -> str:
    """Return the number of a mode with its label, such as "1 bounce"."""
    label = modes.labels[index]
    return f"{index + 1} {label.replace('_', ' ')}" if label else f"{index + 1}"


def in_hertz(frequency: float) -> str:
    """Return a frequency with three or four digits, such as "7.01 Hz" or "19.65 Hz"."""
    n_decimals = 3 if frequency < 1 else 2 if frequency < 100 else 1 if frequency < 1000 else 0
    return f"{frequency:.{n_decimals}f} Hz"


def in_percent(ratio: float) -> str:
    """Return a ratio in percent, such as "1.12 %" or "22.9 %"."""
    return f"{100 * ratio:.2f} %" if abs(ratio) < 0.1 else f"{100 * ratio:.1f} %"


def mode_values(modes: Modes, index: int) -> str:
    """Return frequency and damping of a mode, such as "7.01 Hz, 1.12 %"."""
    return f"{in_hertz(modes.natural_frequency[index])}, {in_percent(modes.damping_ratio[index])}"


def pretty_unit(unit: str) -> str:
    """Return a unit with superscripts."""
    return unit.replace("^2", "²").replace("^3", "³")


def with_unit(what: str, unit: str) -> str:
    """Return the label of an axis: with the unit in brackets, or "as recorded" where it is unknown.

    Examples
    --------
    >>> with_unit("RMS", "m/s^2"), with_unit("RMS", "")
    ('RMS [m/s²]', 'RMS, as recorded')
    """
    return f"{what} [{pretty_unit(unit)}]" if unit else f"{what}, as recorded"


def origin(identification: Identification) -> str:
    """Return the origin of the modes in words: method, channels, sampling rate."""
    names = listed([channel.name for channel in identification.channels])
    method = METHOD_NAMES.get(identification.method, identification.method)
    remark = "" if len(identification.modes) else f". {STYLE.no_mode}"
    return f"{method} of {names} at {identification.sampling_rate:.4g} Hz{remark}"


def percent(log_ratio: ArrayLike) -> Real:
    """Return the relative change [%] of ln values."""
    return 100 * np.expm1(log_ratio)


def text_width(text: str, size: float) -> float:
    """Return the approximate width of the longest line of a text [in]."""
    return max(len(line) for line in text.split("\n")) * STYLE.character * size / 72
