"""Identified and tracked modes as tables and sentences."""

import math
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sprung._arrays import Complex
from sprung._display import counted
from sprung.modal import Modes, PoleStatus
from sprung.results.tables.wording import Table, format_duration, format_estimate, format_name, format_time

if TYPE_CHECKING:
    from sprung.identification import Identification, LevelTrends, RovingSetups, SubsetModes
    from sprung.identification.methods import WindowModes
    from sprung.identification.stabilisation import StabilisationDiagram
    from sprung.identification.tracking import Track, TrackedModes, TrackedValue
    from sprung.signals.harmonics import Harmonic

#: Channels below this share of the largest one are omitted from a shape in words.
_MAIN_SHARE = 0.3
#: Largest number of channels or numbers in a cell, and of families of harmonics in a table.
_MAX_WORDS, _MAX_FAMILIES = 6, 8
#: Largest number of reasons given if no mode was found.
_MAX_REASONS = 3
#: Methods that give modes, in a table.
_SOURCES = {
    "ssi": "SSI",
    "plscf": "pLSCF",
    "fdd": "FDD",
    "road_likelihood": "vehicle on its road",
    "free_response": "free motion",
}
#: Meaning of the columns of `modes_table`.
_MODES_CAPTION = (
    "± standard deviation; stable: share of the model orders with this mode; shape: channels above"
    f" {100 * _MAIN_SHARE:.0f} % of the largest, + in phase with it, - against it, ~ between"
)


def why_none(identification: "Identification") -> str:
    """Return a sentence that explains why there is no mode.

    Examples
    --------
    White noise has no modes:

    >>> import numpy as np
    >>> from sprung.identification import enhanced_fdd
    >>> from sprung.recording import Channel, Recording
    >>> noise = np.random.default_rng(1).standard_normal((2, 6000))
    >>> run = Recording(noise, 100.0, (Channel("a", "acceleration"), Channel("b", "acceleration")))
    >>> why_none(enhanced_fdd(run))
    'no mode found: no peak of the spectra rises significantly: record longer, or widen --band'
    """
    if identification.setups is not None:
        return "no mode found in half of the set-ups or more: identify each file by itself to see its modes"
    reasons: Counter[int] = Counter()
    for subset in identification.subsets:
        for diagram in subset.diagrams:
            reasons.update(diagram.status.tolist())
    if identification.method == "fdd":
        return "no mode found: no peak of the spectra rises significantly: record longer, or widen --band"
    if not reasons:
        return "no mode found: no order has an oscillating pole: raise --max-order"
    if PoleStatus.SELECTED in reasons:
        return "no mode found in half of the subsets or more: record longer, or use fewer --subsets"
    counts = "; ".join(f"{count}: {PoleStatus(status).sentence}" for status, count in reasons.most_common(_MAX_REASONS))
    return f"no mode found in {reasons.total()} poles ({counts}): record longer, or widen --band"


def describe_identification(identification: "Identification") -> str:
    """Return the number of modes, the method and the channels of an identification in a line.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> describe_identification(identification)
    '3 modes by Cov-SSI from 3 channels at 200 Hz'
    """
    from sprung.identification import METHOD_NAMES

    modes, channels = counted(len(identification.modes), "mode"), counted(len(identification.channels), "channel")
    method = METHOD_NAMES.get(identification.method, identification.method)
    words = f"{modes} by {method} from {channels} at {identification.sampling_rate:.5g} Hz"
    if identification.setups is None:
        return words
    names = _listed(identification.setups.references, ", ")
    return f"{words}, {len(identification.setups.parts)} set-ups over references {names}"


def identification_tables(identification: "Identification") -> list[Table]:
    """Return all tables of an identification that have rows.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> [(table.columns[0], len(table.rows)) for table in identification_tables(identification)]
    [('frequency [Hz]', 3)]
    """
    tables = []
    if len(identification.modes):
        tables.append(modes_table(identification.modes, identification.sources))
    if len(identification.modes) and len(identification.subsets) > 1:
        tables.append(subsets_table(identification))
    if len(identification.modes) and identification.setups is not None:
        tables.append(setups_table(identification.modes, identification.setups))
    if identification.harmonics:
        tables.append(harmonics_table(identification.harmonics))
    return tables


def modes_table(modes: Modes, sources: Sequence[str] = ()) -> Table:
    """Return the table of identified modes: values with standard deviations, stability, label and shape in words.

    Parameters
    ----------
    modes
        Modes of any number.
    sources
        Source of each mode as in `Identification`; empty: unknown.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> table = modes_table(identification.modes)
    >>> table.columns[:2], [round(float(row[0].split(" ± ")[0])) for row in table.rows]
    (('frequency [Hz]', 'damping [%]'), [7, 20, 28])
    """
    sources = sources or ("",) * len(modes)
    shapes = describe_shapes(modes.channels, modes.mode_shapes)
    has_sources = "road_likelihood" in sources
    columns = ("frequency [Hz]", "damping [%]", "stable", "MPC", "label", *(["source"] if has_sources else []), "shape")
    rows = tuple(
        (
            format_estimate(modes.natural_frequency[k], modes.natural_frequency_std[k]),
            format_estimate(100 * modes.damping_ratio[k], 100 * modes.damping_ratio_std[k]),
            _stable(modes.stable_rate[k], sources[k]),
            f"{modes.mpc[k]:.2f}",
            format_name(modes.labels[k] or ""),
            *([_SOURCES[sources[k]]] if has_sources else []),
            shapes[k],
        )
        for k in range(len(modes))
    )
    return Table("", columns, rows, n_words=0, caption=_MODES_CAPTION)


def _stable(rate: float, source: str) -> str:
    """Return the stable rate of a mode; "-" for FDD, and for a mode of the road likelihood alone."""
    is_known = np.isfinite(rate) and (rate > 0 or source != "road_likelihood")
    return f"{100 * rate:.0f} %" if is_known else "-"


def describe_shapes(channels: Sequence[str], mode_shapes: Complex) -> list[str]:
    """Return for each shape its main channels and the signs of their motion.

    Examples
    --------
    Front against rear, and left against right at the front:

    >>> import numpy as np
    >>> shapes = np.array([[1.0, 0.9, -0.8, -0.9], [1.0, -1.0, 0.1, 0.1]], dtype=complex)
    >>> describe_shapes(("acc_fl", "acc_fr", "acc_rl", "acc_rr"), shapes)
    ['fl+ fr+ rl- rr-', 'fl+ fr-']
    """
    return [_shape(_without_common_prefix(channels), shape.tolist()) for shape in mode_shapes]


def _without_common_prefix(names: Sequence[str]) -> list[str]:
    """Return names without a common prefix up to their last separator: fl, fr for acc_fl, acc_fr."""
    cuts = [max(name.rfind(separator) for separator in "_-. ") + 1 for name in names]
    prefixes = {name[:cut] for name, cut in zip(names, cuts, strict=True)}
    is_common = len(prefixes) == 1 and not any(name in prefixes for name in names)
    return [name[cuts[0] :] for name in names] if is_common else list(names)


def _shape(names: Sequence[str], shape: Sequence[complex]) -> str:
    """Return the main channels of a shape whose largest channel is 1."""
    main = [k for k, part in enumerate(shape) if abs(part) >= _MAIN_SHARE]
    named = sorted(sorted(main, key=lambda k: -abs(shape[k]))[:_MAX_WORDS])
    words = [names[k] + _sign(shape[k]) for k in named]
    return " ".join([*words, "..."] if len(main) > len(named) else words)


def _sign(part: complex) -> str:
    """Return the sign of a channel: + within 60 degrees of the phase of the largest one, - against it, ~ between."""
    cosine = part.real / abs(part)
    return "~" if abs(cosine) < 0.5 else "+" if cosine > 0 else "-"


def subsets_table(identification: "Identification") -> Table:
    """Return the table of each mode in each subset of segments.

    Examples
    --------
    >>> from sprung.identification import IdentificationSettings, coss_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=120.0, sampling_rate=200.0, seed=1)
    >>> identification = coss_ssi(run, settings=IdentificationSettings(n_subsets=2))
    >>> table = subsets_table(identification)
    >>> len(table.rows), table.columns[-1]
    (3, 'for twice the level')
    """
    columns = ("mode", *(_heading(subset) for subset in identification.subsets), "for twice the level")
    rows = tuple(
        (
            f"{identification.modes.natural_frequency[k]:.4g} Hz",
            *(
                _subset_mode(subset, int(member))
                for subset, member in zip(identification.subsets, identification.members[k], strict=True)
            ),
            _level_trend(identification.level_trends, k),
        )
        for k in range(len(identification.modes))
    )
    return Table("Modes in subsets of segments, by the level of their signals", columns, rows)


def _heading(subset: "SubsetModes") -> str:
    """Return level and number of segments."""
    level = "" if subset.level is None else f"{subset.level[0]:.3g} to {subset.level[1]:.3g}\n"
    return f"{level}{counted(subset.n_segments, 'segment')}"


def _level_trend(trends: "LevelTrends | None", k: int) -> str:
    """Return the change of frequency and damping of a mode for twice the level, with standard deviations."""
    if trends is None or not np.isfinite(trends.p_value[k]):
        return ""
    frequency, damping = 100 * trends.natural_frequency[k], 100 * trends.damping_ratio[k]
    frequency_std, damping_std = 100 * trends.natural_frequency_std[k], 100 * trends.damping_ratio_std[k]
    verdict = "" if trends.is_detected[k] else " (chance)"
    return f"f {frequency:+.2g} ± {frequency_std:.2g} %, damping {damping:+.2g} ± {damping_std:.2g}{verdict}"


def _subset_mode(subset: "SubsetModes", member: int) -> str:
    """Return frequency and damping of a mode in a subset."""
    if member < 0:
        return "-"
    return f"{subset.modes.natural_frequency[member]:.4g} Hz, {100 * subset.modes.damping_ratio[member]:.3g} %"


def setups_table(modes: Modes, setups: "RovingSetups") -> Table:
    """Return the table of each mode in the set-ups: how many show it, and how much they differ."""
    rows = tuple(
        (f"{frequency:.4g} Hz", *_in_setups(setups, mode)) for mode, frequency in enumerate(modes.natural_frequency)
    )
    columns = ("mode", "found in", "frequency [Hz]", "damping [%]", "lowest MAC")
    return Table(
        "Modes in the set-ups",
        columns,
        rows,
        caption="lowest and highest value of all set-ups; MAC of a set-up's own shape with the merged one",
    )


def _in_setups(setups: "RovingSetups", mode: int) -> tuple[str, ...]:
    """Return number of set-ups that show a mode, ranges of frequency and damping, and lowest MAC."""
    showing = [part for part in setups.parts if part.members[mode] >= 0]
    frequency = [part.identification.modes.natural_frequency[part.members[mode]] for part in showing]
    damping = [100 * part.identification.modes.damping_ratio[part.members[mode]] for part in showing]
    return (
        f"{len(showing)} of {len(setups.parts)}",
        f"{min(frequency):.4g} to {max(frequency):.4g}",
        f"{min(damping):.3g} to {max(damping):.3g}",
        f"{min(part.mac[mode] for part in showing):.3f}",
    )


def harmonics_table(harmonics: Sequence["Harmonic"]) -> Table:
    """Return the table of harmonics, strongest first, with the multiples of a fundamental in one row.

    Examples
    --------
    >>> from sprung.signals.harmonics import Harmonic
    >>> first = Harmonic(12.5, "constant", (12.4, 12.6), 0.2, 20.0, ("acc_1",), fundamental=12.5, order=1)
    >>> second = Harmonic(25.0, "constant", (24.9, 25.1), 0.2, 15.0, ("acc_1",), fundamental=12.5, order=2)
    >>> table = harmonics_table([first, second])
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    line | multiples | at [Hz] | prominence | channels
    12.5 Hz | 1 to 2 | 12.4 to 25.1 | 20 dB | acc_1
    """
    families: dict[tuple[str, float], list[Harmonic]] = {}
    for line in harmonics:
        families.setdefault((line.kind, line.fundamental or line.frequency), []).append(line)
    rows = [_family(fundamental, lines) for (_, fundamental), lines in sorted(families.items(), key=_faintness)]
    n_omitted = len(rows) - _MAX_FAMILIES
    if n_omitted > 0:
        rows = [*rows[:_MAX_FAMILIES], (f"{n_omitted} weaker", "", "", "", "")]
    columns = ("line", "multiples", "at [Hz]", "prominence", "channels")
    return Table("Harmonics of the excitation, not modes", columns, tuple(rows), n_words=2)


def _faintness(family: tuple[tuple[str, float], Sequence["Harmonic"]]) -> float:
    """Return the sort key of a family: the most prominent comes first."""
    return -max(line.prominence for line in family[1])


def _family(fundamental: float, lines: Sequence["Harmonic"]) -> tuple[str, ...]:
    """Return the row of a fundamental and its multiples."""
    is_over_time = lines[0].kind != "speed"
    low, high = min(line.band[0] for line in lines), max(line.band[1] for line in lines)
    return (
        f"{fundamental:.4g} {'Hz' if is_over_time else 'per metre'}",
        format_orders(sorted(line.order for line in lines)),
        f"{lines[0].frequency:.4g}" if len(lines) == 1 and lines[0].kind == "constant" else f"{low:.3g} to {high:.3g}",
        f"{max(line.prominence for line in lines):.0f} dB",
        _listed(sorted({name for line in lines for name in line.channels})),
    )


def format_orders(orders: Sequence[int]) -> str:
    """Return rising orders as ranges, such as 1 to 4, 6; empty for a single line.

    Examples
    --------
    >>> format_orders([1, 2, 3, 4, 6])
    '1 to 4, 6'
    """
    if orders[-1] == 1:
        return ""
    starts = [k for k in range(len(orders)) if k == 0 or orders[k] > orders[k - 1] + 1]
    runs = [(orders[first], orders[last - 1]) for first, last in pairwise([*starts, len(orders)])]
    return _listed([f"{first}" if first == last else f"{first} to {last}" for first, last in runs], ", ")


def _listed(words: Sequence[str], separator: str = " ") -> str:
    """Return words in a row, with an ellipsis after the first few."""
    return separator.join([*words[:_MAX_WORDS], *(["..."] if len(words) > _MAX_WORDS else [])])


def diagram_table(diagram: "StabilisationDiagram") -> Table:
    """Return the table of the numbers of poles of each status."""
    counts = {status: int((diagram.status == status).sum()) for status in PoleStatus}
    rows = tuple((str(count), status.sentence) for status, count in counts.items() if count)
    return Table("Stabilisation diagram", ("poles", "status"), rows, n_words=0)


#: Largest number of jumps in a cell, and of windows without a result in the sentences.
_MAX_LISTED = 3
#: Fewest windows for a ratio of deviations.
_FOR_RATIO = 8
_CAPTION = (
    "frequency and damping: mean ± scatter of the windows, without trend and jumps; change: of the frequency, by a"
    " straight line through the whole track; scatter / stated: that scatter over the standard deviation stated by the"
    " identifications, 1 where the mode is steady and the stated ones are right"
)


def tracks_table(tracked: "TrackedModes", *, start: int | None = None, has_times: bool | None = None) -> Table:
    """Return the table of tracked modes, one line for each.

    Parameters
    ----------
    tracked
        Result of `track_modes`.
    start
        Time of the first window, UTC in nanoseconds since 1970; None if unknown.
    has_times
        Whether times are seconds, not numbers of windows; None: as the modes were tracked.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.identification.tracking import track_modes
    >>> from sprung.modal import Modes
    >>> some = np.full(2, 0.01)
    >>> poles = 2 * np.pi * np.array([2.0, 5.0]) * (1j - 0.01)
    >>> modes = Modes(poles, np.eye(2, dtype=complex), ("a", "b"), some, some, np.ones(2), (None, None))
    >>> tracked = track_modes([modes] * 6, times=3600.0 * np.arange(6))
    >>> table = tracks_table(tracked)
    >>> [row[:2] for row in table.rows], table.columns[:2]
    ([('1', '2'), ('2', '5')], ('mode', 'frequency [Hz]'))
    """
    has_times = tracked.has_times if has_times is None else has_times
    columns = (
        "mode",
        "frequency [Hz]",
        "change [%]",
        "damping [%]",
        "scatter / stated",
        "windows",
        "first\nlast",
        "jumps",
    )
    rows = tuple(
        (
            f"{number} {format_name(track.label or '')}".strip(),
            format_estimate(track.natural_frequency.mean, track.natural_frequency.scatter),
            format_change(track.natural_frequency),
            format_estimate(100 * track.damping_ratio.mean, 100 * track.damping_ratio.scatter),
            _ratio(track.natural_frequency, len(track)),
            f"{len(track)} ({100 * track.presence:.0f} %)",
            "\n".join(
                format_moment(float(time), start=start, has_times=has_times)
                for time in (track.times[0], track.times[-1])
            ),
            "\n".join(describe_jumps(tracked, track, start=start, has_times=has_times)),
        )
        for number, track in enumerate(tracked.tracks, start=1)
    )
    return Table("", columns, rows, caption=_CAPTION)


def describe_tracks(tracked: "TrackedModes") -> str:
    """Return the number of modes and windows in a line.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.identification.tracking import track_modes
    >>> from sprung.modal import Modes
    >>> some = np.full(2, 0.01)
    >>> poles = 2 * np.pi * np.array([2.0, 5.0]) * (1j - 0.01)
    >>> modes = Modes(poles, np.eye(2, dtype=complex), ("a", "b"), some, some, np.ones(2), (None, None))
    >>> tracked = track_modes([modes] * 6, times=3600.0 * np.arange(6))
    >>> describe_tracks(tracked)
    '2 modes followed over 6 windows with modes, of 6'
    """
    count = counted(int(tracked.has_result.sum()), "window")
    return f"{counted(len(tracked.tracks), 'mode')} followed over {count} with modes, of {len(tracked.times)}"


def tracks_notes(tracked: "TrackedModes", windows: Sequence["WindowModes"]) -> list[str]:
    """Return sentences on the layout of the sensors, on windows without modes, and on modes that belong to no track.

    Examples
    --------
    >>> from sprung.identification.methods import WindowModes
    >>> import numpy as np
    >>> from sprung.identification.tracking import track_modes
    >>> from sprung.modal import Modes
    >>> some = np.full(2, 0.01)
    >>> poles = 2 * np.pi * np.array([2.0, 5.0]) * (1j - 0.01)
    >>> modes = Modes(poles, np.eye(2, dtype=complex), ("a", "b"), some, some, np.ones(2), (None, None))
    >>> tracked = track_modes([*[modes] * 6, None])
    >>> windows = [*(WindowModes(k, "run.csv", modes) for k in range(6)), WindowModes(6, "run.csv", None, "too short")]
    >>> tracks_notes(tracked, windows)
    ['window 7 (run.csv): too short']
    """
    notes = list(dict.fromkeys(note for window in windows for note in window.notes))
    empty = [(number, window) for number, window in enumerate(windows, start=1) if window.reason]
    notes += [f"window {number} ({window.source}): {window.reason}" for number, window in empty[:_MAX_LISTED]]
    if len(empty) > _MAX_LISTED:
        notes.append(f"{counted(len(empty) - _MAX_LISTED, 'further window')} without modes")
    n_untracked = sum(len(track) for track in tracked.untracked_modes)
    if n_untracked:
        settings = tracked.settings
        total = n_untracked + sum(len(track) for track in tracked.tracks)
        notes.append(
            f"{n_untracked} of {counted(total, 'identified mode')} belong to no track: not seen"
            f" {settings.min_count} times in {settings.out_of} windows, or second estimates of one mode"
        )
    return notes


def describe_jumps(tracked: "TrackedModes", track: "Track", *, start: int | None, has_times: bool) -> list[str]:
    """Return the sudden changes of a track's frequency, the first few of many."""
    words = [
        f"{100 * (jump.after / jump.before - 1):+.2g} % at "
        + format_moment(float(tracked.times[jump.window]), start=start, has_times=has_times)
        for jump in track.jumps
    ]
    return [*words[:_MAX_LISTED], "..."] if len(words) > _MAX_LISTED else words


def format_change(value: "TrackedValue") -> str:
    """Return the relative change over a track [%] with its standard deviation; empty for a short one."""
    trend = value.trend
    if trend is None:
        return ""
    return format_estimate(100 * trend.change / value.mean, 100 * trend.change_std / value.mean)


def format_moment(time: float, *, start: int | None, has_times: bool) -> str:
    """Return the time of a window: date and minute, time since the first window, or number of the window."""
    if not has_times:
        return str(round(time) + 1)
    if start is not None:
        return format_time(start + round(1e9 * time))
    return format_duration(time)


def _ratio(value: "TrackedValue", n_windows: int) -> str:
    """Return scatter over stated deviation; empty if one is unknown or rests on few windows."""
    ratio = value.scatter / value.stated if value.stated > 0 and n_windows >= _FOR_RATIO else math.nan
    return f"{ratio:.2g}" if math.isfinite(ratio) else ""
