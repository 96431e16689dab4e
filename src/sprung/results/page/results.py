"""Reports on results, and what they state about their files."""

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sprung import __version__
from sprung.bounce_tests import Bounce
from sprung.diagnosis import Baseline, Diagnosis, ModeChange
from sprung.formats import ReadSettings, read_records
from sprung.identification import Identification
from sprung.identification.ladders import BlockRowLadder
from sprung.identification.tracking import TrackedModes
from sprung.likelihood import CornerFit
from sprung.likelihood.plate_test import plate_tests
from sprung.results import tables
from sprung.results.documents import Document
from sprung.results.page.page import Block, Paragraph, Picture, Report, Section, Sentences, picture
from sprung.results.renderings import document_of, picture_of
from sprung.results.tables.identification import describe_jumps
from sprung.results.tables.wording import Table, format_estimate, format_name
from sprung.signals.inspection import Inspection, inspect_blocks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Most files whose channels are listed.
_MAX_LISTED = 3


@dataclass(frozen=True, eq=False, slots=True)
class Inputs:
    """Files behind a result.

    Parameters
    ----------
    files
        Files that were analysed.
    inspections
        Facts about each recording, by the path of its file; empty where the files are not recordings.
    others
        Purpose and name of further files, such as the vehicle file.
    """

    files: tuple[Path, ...]
    inspections: Mapping[str, Inspection]
    others: Mapping[str, str]

    @property
    def title(self) -> str:
        """Name of the file, or number of files."""
        return self.files[0].name if len(self.files) == 1 else tables.counted(len(self.files), "file")


def inspected(
    files: Sequence[Path],
    *,
    settings: ReadSettings | None = None,
    others: Mapping[str, str] | None = None,
) -> Inputs:
    """Return the facts about recordings for a report.

    Parameters
    ----------
    files
        Recordings, which are read once more, one after the other.
    settings
        As for `sprung.read`.
    others
        Purpose and name of further files, such as the vehicle file.

    Raises
    ------
    SprungError
        As raised by `sprung.read`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import sprung
    >>> run = sprung.Recording(np.sin(np.arange(500.0))[None], 100.0, (sprung.Channel("acc_fl", "acceleration"),))
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "run.csv")
    ...     sprung.write(run, path)
    ...     inputs = inspected([path], others={"vehicle file": "zafira.toml"})
    >>> inputs.title, [inspection.n_samples for inspection in inputs.inspections.values()]
    ('run.csv', [500])
    """
    inspections = {str(path): inspect_blocks(read_records([path], settings=settings)) for path in files}
    return Inputs(tuple(files), inspections, others or {})


def data_section(inputs: Inputs) -> Section:
    """Return the section on the quality of the data."""
    several = len(inputs.inspections) > 1
    faults = {name: _faults(inspection) for name, inspection in inputs.inspections.items()}
    every = (f"{name}, {fault}" if several else fault for name, own in faults.items() for fault in own)
    blocks: list[Block] = [Sentences(tuple(dict.fromkeys(every)))]
    if inputs.inspections and not any(faults.values()):
        blocks = [Paragraph("No channel shows a fault, and no value is missing.")]
    for number, (name, inspection) in enumerate(inputs.inspections.items()):
        blocks.append(Paragraph(f"{name}: {tables.describe_inspection(inspection)}"))
        if number < _MAX_LISTED:
            blocks += [tables.inspection_table(inspection), Sentences(inspection.history)]
        else:
            blocks.append(Sentences(faults[name]))
    return Section("Data", tuple(blocks))


def footer(inputs: Inputs) -> str:
    """Return files, command, versions and time of a report in a line."""
    parts = [f"{purpose}: {name}" for purpose, name in inputs.others.items()]
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy"))
    parts.append(f"sprung {__version__} (Python {platform.python_version()}, {packages})")
    return "; ".join([*parts, f"written {datetime.now(UTC):%Y-%m-%d %H:%M} UTC"])


def _faults(inspection: Inspection) -> tuple[str, ...]:
    """Return a sentence for each faulty channel."""
    table = tables.inspection_table(inspection)
    return tuple(f"{row[0]}: {row[-1]}" for row in table.rows if row[-1])


#: Resolution of the figures [dots per inch], and largest JSON document that is embedded [characters].
_RESOLUTION, _LARGEST = 130, 1_000_000
#: Modes in the first sentence, and standard deviations from which on a component differs from the vehicle file.
_MAX_MODES, _DIFFERENT = 8, 3.0
#: Model errors below which the vehicle file explains a run, and above which it lacks a moving part.
_EXPLAINS, _LACKS = 0.05, 0.1
#: Units of the inputs of a road; the others are ratios.
_INPUT_UNITS = {"roughness": "m³ (at 0.1 cycles per metre)", "coherence_length": "m"}

_CAPTIONS = {
    "identification": {
        "stabilisation": "Stabilisation diagram: poles of all model orders; modes are columns of stable poles.",
        "spectra": "Spectra of the channels, with the identified modes and the harmonics of the excitation.",
        "mode_shapes": "Mode shapes, 1 at the largest channel.",
        "complexity": "Complexity of the shapes: channels that move in phase or against it lie on a line.",
        "mac": "Modal assurance criterion (MAC) between the modes: 1 for equal shapes, 0 for orthogonal ones.",
        "subsets": "Frequency and damping of each mode against the level of the vibration.",
    },
    "bounce": {"bounce": "Free motion after each push, with the fit and the envelope of its strongest mode."},
    "corners": {
        "corners": "Springs, dampers and tyres against the vehicle file, with 95 % intervals.",
        "spectra": "Measured spectra and those of the fitted vehicle.",
        "correlation": "Correlation of the estimates: strongly correlated components are known only in combination.",
    },
    "diagnosis": {
        "evidence": "Evidence of a change after each window with its threshold, and the most likely hypotheses.",
        "trends": "Every component over time, with 95 % intervals, in the range of usual windows (grey).",
        "corners": "Change of every component, with 95 % intervals.",
        "modes": "Body modes before and after the change, as the finding implies them.",
    },
}


def identification_report(
    identification: Identification, inputs: Inputs, *, document: Document | None = None
) -> Report:
    """Return the report of an identification.

    Parameters
    ----------
    identification
        Result of any method.
    inputs
        Files behind it.
    document
        Its document, which is embedded if it is not too large.

    Examples
    --------
    >>> from pathlib import Path
    >>> from sprung.results.page import Inputs
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run.select(["acc_1"]))
    >>> report = identification_report(identification, Inputs((Path("run.csv"),), {}, {}))
    >>> report.title, [section.title for section in report.sections]
    ('Modes of run.csv', ['Modes', 'Notes', 'Figures', 'Settings', 'What this says, and what it does not'])
    """
    from sprung.results.figures.saving import figures

    modes = identification.modes
    shown = [
        f"{modes.natural_frequency[k]:.4g} Hz ({100 * modes.damping_ratio[k]:.2g} % damping"
        + (f", {format_name(label)})" if (label := modes.labels[k]) else ")")
        for k in range(min(len(modes), _MAX_MODES))
    ]
    more = f" and {len(modes) - len(shown)} more" if len(modes) > len(shown) else ""
    verdict = f"{tables.counted(len(modes), 'mode')} found: {', '.join(shown)}{more}."
    origin = Paragraph(tables.describe_identification(identification) + ".")
    limits = [
        "± is one standard deviation, from the scatter of the blocks of the records: it covers chance, not changes of"
        " the conditions. The true value lies within two of them in about 95 of 100 cases.",
        "Modes that the excitation hardly reaches, or that no sensor observes, are not found. Harmonics of machines are"
        " listed separately where they are recognised.",
        "Shapes are relative: without known forces they have no scale, and modal masses cannot be stated.",
    ]
    if len(identification.channels) == 1:
        limits.append(
            "A single channel gives no shapes, and its noise cannot be distinguished from motion with certainty."
        )
    return _report(
        f"Modes of {inputs.title}",
        verdict if len(modes) else _sentence(tables.why_none(identification)),
        [
            Section("Modes", (origin, *tables.identification_tables(identification))),
            _notes(identification.notes),
            _pictures(figures(identification, source=inputs.title), _CAPTIONS["identification"]),
            data_section(inputs),
            Section("Settings", (_plan_table(identification),)),
            _limits(limits),
        ],
        inputs,
        document,
    )


def bounce_report(bounce: Bounce, inputs: Inputs, *, document: Document | None = None) -> Report:
    """Return the report of bounce tests; parameters as for `identification_report`."""
    from sprung.results.figures.measured import bounce_figure

    limits = [
        "± is one standard deviation; it covers noise, and motion that the fit does not explain, of these tests alone:"
        " another push, load or temperature may differ by more.",
        "Frequencies and damping are those of free motion of this size: dampers and friction depend on it.",
        "Springs and dampers rest on masses and positions in the vehicle file.",
    ]
    sections = [
        Section("Results", tuple(tables.bounce_tables(bounce))),
        _notes(bounce.notes),
        _pictures({"bounce": bounce_figure(bounce, source=inputs.title)}, _CAPTIONS["bounce"]),
        data_section(inputs),
        _limits(limits),
    ]
    verdict = _sentence(f"{tables.describe_bounce(bounce)}: {bounce.modes.in_words}")
    return _report(f"Bounce test: {inputs.title}", verdict, sections, inputs, document)


def corners_report(fit: CornerFit, inputs: Inputs, *, document: Document | None = None) -> Report:
    """Return the report of a fit of springs, dampers and tyres; parameters as for `identification_report`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from sprung.results.page import Inputs
    >>> from sprung.likelihood import CornerSettings, fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=30.0, sampling_rate=60.0, snr=50.0), seed=1)
    >>> fit = fit_corners(drive.recording, vehicle, settings=CornerSettings(free=("spring",)))
    >>> report = corners_report(fit, Inputs((Path("drive.csv"),), {}, {}))
    >>> report.title
    'Springs, dampers and tyres from drive.csv'
    >>> [section.title for section in report.sections]
    ['Components', 'Modes', 'Inspection', 'Figures', 'Settings', 'What this says, and what it does not']
    """
    from sprung.results.figures.saving import corner_figures

    ratios, deviations = fit.log_ratios, fit.log_ratios_std
    known = np.flatnonzero(fit.is_identifiable & (np.abs(ratios) > _DIFFERENT * deviations))
    farthest = sorted(known, key=lambda k: -abs(ratios[k]))[:_MAX_MODES]
    apart = ", ".join(
        f"{format_name(str(fit.components[k]))} {format_estimate(*_percent(ratios[k], deviations[k]))} %"
        for k in farthest
    )
    differing = f"Different from the vehicle file: {apart}." if apart else "None differs from the vehicle file."
    determined = f"{int(fit.is_identifiable.sum())} of {len(fit.components)} springs, dampers and tyres"
    verdict = f"{determined} are determined by these data. {differing} {_describe_fit(fit)}"
    limits = [
        "± is one standard deviation. It covers chance and the misfit of the model, not what the vehicle file omits or"
        " states wrongly.",
        "Left against right is more certain than absolute values, which depend on masses and positions in the file.",
        "Friction and asymmetric dampers appear as damping: the fitted vehicle is linear.",
        "Components marked as not identifiable stay near the values of the file: no conclusion is drawn about them.",
    ]
    return _report(
        f"Springs, dampers and tyres from {inputs.title}",
        verdict,
        [
            Section("Components", (tables.components_table(fit), Sentences(tuple(tables.describe_payload(fit))))),
            Section("Modes", (tables.fitted_modes_table(fit),)),
            *([Section("Inspection", (tables.plate_tests_table(tests),))] if (tests := plate_tests(fit)) else []),
            *[Section("Wheels", (table,)) for table in tables.run_out_tables(fit)],
            _notes(fit.notes),
            _pictures(corner_figures(fit, source=inputs.title), _CAPTIONS["corners"]),
            data_section(inputs),
            Section("Settings", (_fit_table(fit),)),
            _limits(limits),
        ],
        inputs,
        document,
    )


def diagnosis_report(
    diagnosis: Diagnosis,
    inputs: Inputs,
    *,
    baseline: Baseline | None = None,
    changes: Sequence[ModeChange] = (),
    document: Document | None = None,
) -> Report:
    """Return the report of a diagnosis.

    Parameters
    ----------
    diagnosis
        Result of `sprung.diagnose`.
    inputs
        Files behind it.
    baseline
        Baseline of the diagnosis; None: the vehicle file.
    changes
        Modes before and after the findings.
    document
        Its document, which is embedded if it is not too large.

    Examples
    --------
    >>> from pathlib import Path
    >>> from sprung.results.page import Inputs
    >>> import numpy as np
    >>> import sprung
    >>> nothing = np.zeros(0)
    >>> window = sprung.Observation(0.0, (), nothing, np.zeros((0, 0)), {}, {}, (), reason="the vehicle stood still")
    >>> report = diagnosis_report(sprung.diagnose([window]), Inputs((Path("drive.csv"),), {}, {}))
    >>> print(report.verdict)
    Inconclusive: no window was usable.
    >>> [section.title for section in report.sections]
    ['Notes', 'Windows', 'What this says, and what it does not']
    """
    first, *others = tables.describe_diagnosis(diagnosis)
    windows = diagnosis.observations
    n_usable = sum(window.is_conclusive for window in windows)
    sections = [Section("Result", (Sentences(tuple(others)), *tables.diagnosis_tables(diagnosis, changes)))]
    if diagnosis.detection is not None:
        from sprung.results.figures.saving import diagnosis_figures

        drawn = diagnosis_figures(diagnosis, baseline, changes)
        sections.append(_pictures(drawn, _CAPTIONS["diagnosis"]))
    reasons = [
        f"window at {window.time / 60:.4g} min: {window.reason}" for window in windows if not window.is_conclusive
    ]
    used = Paragraph(f"{n_usable} of {tables.counted(len(windows), 'window')} were usable.")
    limits = [
        "A change is reported where the evidence of all windows together exceeds a threshold, which is set by the rate"
        f" of false alarms: {diagnosis.false_alarms:g} per vehicle and day.",
        "'No change detected' refers to changes as large as the stated detectable ones; smaller ones may be present.",
        "Parts that the model does not include (mounts, bushings, joints, wheels) are not diagnosed; where they change,"
        " the result is a change that no single part explains.",
        "The diagnosis does not replace an inspection.",
    ]
    if diagnosis.baseline is None or diagnosis.baseline.n_windows == 0:
        limits.insert(0, "This vehicle has no baseline: it was compared with its vehicle file, with wide limits.")
    return _report(
        f"Diagnosis of {windows[0].vehicle if windows and windows[0].vehicle else inputs.title}",
        _sentence(first),
        [
            *sections,
            _notes(diagnosis.notes),
            Section("Windows", (used, Sentences(tuple(reasons)))),
            data_section(inputs),
            _limits(limits),
        ],
        inputs,
        document,
    )


def tracking_report(
    tracked: TrackedModes,
    inputs: Inputs,
    *,
    start: int | None = None,
    has_times: bool = True,
    notes: Sequence[str] = (),
    document: Document | None = None,
) -> Report:
    """Return the report of modes over time.

    Parameters
    ----------
    tracked
        Result of `track_modes`.
    inputs
        Files behind it.
    start, has_times
        As for `tables.tracks_table`.
    notes
        Reservations, one sentence each.
    document
        Its document, which is embedded if it is not too large.

    Examples
    --------
    >>> from pathlib import Path
    >>> from sprung.results.page import Inputs
    >>> import numpy as np
    >>> from sprung.identification.tracking import track_modes
    >>> from sprung.modal import Modes
    >>> some = np.full(2, 0.01)
    >>> poles = 2 * np.pi * np.array([2.0, 5.0]) * (1j - 0.01)
    >>> modes = Modes(poles, np.eye(2, dtype=complex), ("a", "b"), some, some, np.ones(2), (None, None))
    >>> tracked = track_modes([modes] * 6, times=3600.0 * np.arange(6))
    >>> print(tracking_report(tracked, Inputs((Path("drives.csv"),), {}, {})).verdict)
    2 modes followed over 6 windows with modes, of 6: 2 Hz, 5 Hz. No frequency changed suddenly.
    """
    from sprung.results.figures.history import tracks_figure

    shown = ", ".join(f"{track.natural_frequency.mean:.4g} Hz" for track in tracked.tracks[:_MAX_MODES])
    more = f" and {len(tracked.tracks) - _MAX_MODES} more" if len(tracked.tracks) > _MAX_MODES else ""
    verdict = f"{tables.describe_tracks(tracked)}: {shown}{more}." if shown else f"{tables.describe_tracks(tracked)}."
    jumps = [
        f"mode {number}: {words}"
        for number, track in enumerate(tracked.tracks, start=1)
        for words in describe_jumps(tracked, track, start=start, has_times=has_times)
    ]
    verdict += f" Sudden changes of frequency: {'; '.join(jumps)}." if jumps else " No frequency changed suddenly."
    figure = tracks_figure(tracked, start=start, has_times=has_times, source=inputs.title)
    limits = [
        "Modes of different windows are taken as one where frequency and shape agree within their standard deviations."
        f" A sudden change of frequency by up to {100 * tracked.settings.reach:g} % with the same shape is followed.",
        "A change of frequency alone does not mean damage: temperature, load and vibration amplitude change it, too.",
    ]
    caption = "Frequency and damping of every mode over time, with 95 % intervals."
    sections = [
        Section("Modes", (tables.tracks_table(tracked, start=start, has_times=has_times),)),
        _notes(notes),
        _pictures({"tracks": figure}, {"tracks": caption}),
        data_section(inputs),
    ]
    return _report(f"Modes over time: {inputs.title}", verdict, [*sections, _limits(limits)], inputs, document)


def plain_report(
    title: str, sentences: Sequence[str], tables: Sequence[Table], value: object, inputs: Inputs
) -> Report:
    """Return the report of a value with one picture: sentences, tables, picture, and its document.

    Parameters
    ----------
    title
        Title.
    sentences
        What was found; the first one begins the report.
    tables
        Tables of the value.
    value
        Value with a document and a picture.
    inputs
        Files behind it.
    """
    figure = picture_of(value)
    sections = [
        Section("Result", tuple(tables)),
        _notes(sentences[1:]),
        Section("Figures", (picture(figure, title, resolution=_RESOLUTION),)),
        data_section(inputs),
    ]
    verdict = _sentence(sentences[0]) if sentences else ""
    return _report(title, verdict, sections, inputs, document_of(value))


def _report(title: str, verdict: str, sections: Sequence[Section], inputs: Inputs, document: Document | None) -> Report:
    """Return a report of the sections that say something, with its document unless that is too large, and footer."""
    fields = None if document is None else document.as_json()
    filled = tuple(section for section in sections if section.blocks)
    report = Report(title, verdict, filled, document=fields, footer=footer(inputs))
    return report if len(report.data) <= _LARGEST else replace(report, document=None)


def _pictures(drawn: Mapping[str, "Figure"], captions: Mapping[str, str]) -> Section:
    pictures: list[Picture] = [
        picture(figure, f"Figure {number}. {captions.get(name, format_name(name))}", resolution=_RESOLUTION)
        for number, (name, figure) in enumerate(drawn.items(), start=1)
    ]
    return Section("Figures", tuple(pictures))


def _notes(notes: Sequence[str]) -> Section:
    return Section("Notes", (Sentences(tuple(notes)),))


def _limits(lines: Sequence[str]) -> Section:
    """Return the section on what the result says."""
    return Section("What this says, and what it does not", (Sentences(tuple(lines)),))


def _sentence(text: str) -> str:
    """Return text with a capital and a full stop."""
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")


def _percent(log_ratio: float, deviation: float) -> tuple[float, float]:
    """Return the relative change of a component and its standard deviation [%]."""
    return 100 * float(np.expm1(log_ratio)), 100 * float(np.exp(log_ratio) * deviation)


def _describe_fit(fit: CornerFit) -> str:
    """Return how well the vehicle file explains the run, in a sentence."""
    percent = f"(model error {100 * fit.model_error:.0f} %)"
    if fit.model_error < _EXPLAINS:
        return f"The vehicle file explains the run {percent}."
    if fit.model_error < _LACKS:
        return f"The vehicle file explains most of the run {percent}."
    return f"The vehicle file explains the run poorly {percent}: absolute values are not reliable."


def _plan_table(identification: Identification) -> Table:
    """Return the table of settings and choices of an identification."""
    plan, settings = identification.plan, identification.effective_settings
    low, high = identification.band
    rows = [
        ("method", identification.method),
        ("channels", ", ".join(channel.name for channel in identification.channels)),
        ("references", "all channels" if settings.references is None else ", ".join(settings.references)),
        ("sampling rate of the records", f"{plan.preparation.sampling_rate:.6g} Hz"),
        ("sampling rate of the identification", f"{identification.sampling_rate:.6g} Hz"),
        ("band", f"{low:.4g} to {high:.4g} Hz"),
        ("high-pass filter", f"{plan.preparation.high_pass:.4g} Hz" if plan.preparation.high_pass else "none"),
        ("segments", f"{plan.segment:.4g} s"),
        ("lifter", "none" if settings.lifter is None else str(settings.lifter)),
    ]
    if isinstance(plan.ladder, BlockRowLadder):
        rows.append(("ladder", str(plan.ladder)))
    else:
        rows += [("block rows", str(plan.ladder.block_rows)), ("largest model order", str(plan.ladder.max_order))]
    return Table("", ("setting", "value"), tuple(rows))


def _fit_table(fit: CornerFit) -> Table:
    """Return the table of the data and settings of a fit."""
    frequencies = fit.model.spectra.frequencies
    rows = (
        ("segments used", str(fit.n_segments)),
        ("segments left out for their speed", str(fit.n_rejected)),
        ("band", f"{frequencies[0]:.3g} to {frequencies[-1]:.3g} Hz"),
        ("model error", f"{100 * fit.model_error:.1f} %"),
        *(
            (f"excitation: {format_name(name)}", f"{value:.4g} {_INPUT_UNITS.get(name, '')}".strip())
            for name, value in fit.inputs.items()
        ),
    )
    return Table("", ("setting", "value"), rows)
