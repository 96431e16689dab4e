"""Spectra, stabilisation diagram and subsets by level of one window, from its archived samples.

The module runs as a program, too: a request on standard input, the answer on standard output, both JSON.
"""

import json
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from sprung.diagnosis.sensors import valid_part
from sprung.errors import SprungError
from sprung.identification import METHODS, BlockRowLadder, Identification
from sprung.likelihood import CornerFit
from sprung.likelihood.fitting import fit_windows
from sprung.link.archive import read_archive
from sprung.modal import PoleStatus
from sprung.online.monitor.engine import IDENTIFICATION
from sprung.online.monitor.jobs import limited_memory
from sprung.recording import Channel, Gap, Recording
from sprung.results.documents import identification_document
from sprung.vehicles import Vehicle, vehicle_from_text
from sprung.vehicles.window import window_of

#: Largest memory that the diagrams of a window may take in addition to what their process holds [bytes].
_MAX_BYTES = 1.5e9
#: Digits of the values.
_DIGITS = 6


@dataclass(frozen=True, eq=False, slots=True)
class Diagrams:
    """Results from the samples of a window in addition to those in the store.

    Parameters
    ----------
    identification
        Modes of the whole window, with spectra, lines and stabilisation diagram, as the monitor identifies them.
    levels
        Modes of its segments sorted by level (CoSS-SSI); None if they cannot be sorted.
    fit
        Fit of the vehicle to its spectra; None if there is none.
    notes
        Reasons why parts are missing, one sentence each.
    """

    identification: Identification
    levels: Identification | None
    fit: CornerFit | None
    notes: tuple[str, ...] = ()


def archived_recording(path: Path | str, quantities: Mapping[str, str]) -> Recording:
    """Return the samples of a window as they were analysed.

    Parameters
    ----------
    path
        File of the archive.
    quantities
        Quantity of each channel, by name.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """
    kept = read_archive(path)
    channels = tuple(Channel(name, quantities.get(name) or "unknown") for name in kept.channels)
    gaps = tuple(Gap(index, length) for index, length in kept.gaps)
    return Recording(kept.samples, kept.sampling_rate, channels, kept.t0 or None, gaps)


def window_diagrams(recording: Recording, vehicle: Vehicle, *, method: str = "cov") -> Diagrams:
    """Return the diagrams of a window, by the functions and settings with which the monitor analyses it.

    Parameters
    ----------
    recording
        Samples of the window.
    vehicle
        Vehicle with its sensors.
    method
        Identification method of the monitor: "cov", "acs" or "coss".

    Raises
    ------
    SprungError
        If the window cannot be identified, such as one in which the vehicle stood still.
    """
    identification = METHODS[method](recording, settings=IDENTIFICATION, vehicle=vehicle)
    notes = []
    levels = fit = None
    try:
        levels = METHODS["coss"](recording, settings=IDENTIFICATION, vehicle=vehicle)
    except SprungError as error:
        notes.append(f"the segments are not sorted by level: {error}")
    try:
        window, _ = valid_part(window_of(recording, vehicle, allow_missing=True))
        fit = fit_windows([window])
    except SprungError as error:
        notes.append(f"the vehicle is not fitted to the spectra: {error}")
    return Diagrams(identification, levels, fit, tuple(notes))


def diagram_values(diagrams: Diagrams, *, vehicle: Vehicle) -> dict[str, Any]:
    """Return the values of diagrams as JSON holds them, with six digits.

    Parameters
    ----------
    diagrams
        Diagrams of a window.
    vehicle
        Vehicle of the window.
    """
    identification, levels = diagrams.identification, diagrams.levels
    return {
        "spectra": _spectra(identification),
        "fit": None if diagrams.fit is None else _fit(diagrams.fit),
        "stabilisation": _stabilisation(identification),
        "identification": identification_document(identification, vehicle=vehicle).as_json(),
        "levels": None if levels is None else identification_document(levels, vehicle=vehicle).as_json(),
        "notes": list(diagrams.notes),
    }


def diagram_pictures(diagrams: Diagrams, *, source: str) -> dict[str, str]:
    """Return the figures of diagrams as SVG, by name: those that the command line draws from the same samples.

    Parameters
    ----------
    diagrams
        Diagrams of a window.
    source
        Name of the window, for the headings.
    """
    from sprung.results.figures import fitted_spectra_figure, spectra_figure, stabilisation_figure, subsets_figure

    drawn = {
        "spectra": spectra_figure(diagrams.identification, source=source),
        "stabilisation": stabilisation_figure(diagrams.identification, source=source),
    }
    if diagrams.fit is not None:
        drawn["fit"] = fitted_spectra_figure(diagrams.fit, source=source)
    if diagrams.levels is not None:
        drawn["levels"] = subsets_figure(diagrams.levels, source=source)
    pictures = {}
    for name, figure in drawn.items():
        text = StringIO()
        figure.savefig(text, format="svg")
        pictures[name] = text.getvalue()
    return pictures


def answer(request: Mapping[str, Any]) -> dict[str, Any]:
    """Return values and figures of the window of a request, or the sentence that states why there are none.

    Parameters
    ----------
    request
        "samples": file of the archive; "quantities": quantity of each channel; "description": text of the vehicle file;
        "method": identification method; "source": name of the window.
    """
    try:
        with limited_memory(_MAX_BYTES):
            vehicle = vehicle_from_text(request["description"], source="the vehicle file")
            recording = archived_recording(request["samples"], request["quantities"])
            diagrams = window_diagrams(recording, vehicle, method=request["method"])
            values = diagram_values(diagrams, vehicle=vehicle)
            return {"values": values, "pictures": diagram_pictures(diagrams, source=request["source"])}
    except SprungError as error:
        return {"error": str(error)}
    except MemoryError:
        return {"error": f"they need more memory than {_MAX_BYTES / 1e9:g} GB"}


def _spectra(identification: Identification) -> dict[str, Any]:
    """Return the power spectral density of each channel."""
    spectra, edited = identification.spectra, identification.edited_spectra
    return {
        "frequencies": _plain(spectra.frequencies),
        "segment_length": spectra.segment_length,
        "n_segments": spectra.n_segments,
        "channels": [
            {
                "channel": channel.name,
                "unit": channel.unit,
                "density": _plain(spectra.densities[row]),
                "edited": None if edited is None else _plain(edited.densities[row]),
            }
            for row, channel in enumerate(identification.channels)
        ],
    }


def _fit(fit: CornerFit) -> dict[str, Any]:
    """Return measured and fitted spectra of each coordinate."""
    from sprung.results.figures.diagnosis import mean_spectra, unit_of_spectra

    measured, fitted = mean_spectra(fit)
    return {
        "frequencies": _plain(fit.model.spectra.frequencies),
        "n_segments": fit.model.spectra.n_segments,
        "model_error": fit.model_error,
        "coordinates": [
            {
                "coordinate": name,
                "unit": unit_of_spectra(name),
                "measured": _plain(measured[row]),
                "fitted": _plain(fitted[row]),
                "misfit": _plain(fit.misfit[row]),
            }
            for row, name in enumerate(fit.model.layout.coordinates)
        ],
    }


def _stabilisation(identification: Identification) -> dict[str, Any]:
    """Return the poles of all rungs with their status."""
    diagrams = [diagram for subset in identification.subsets for diagram in subset.diagrams]
    is_of_rows = isinstance(identification.plan.ladder, BlockRowLadder)
    return {
        "rung": "number of block rows" if is_of_rows else "model order",
        "band": list(identification.band),
        "poles": [
            {
                "natural_frequency": _plain(diagram.poles.natural_frequency),
                "damping_ratio": _plain(diagram.poles.damping_ratio),
                "rung": np.array(diagram.poles.ladder)[diagram.poles.rungs].tolist(),
                "status": [PoleStatus(status).name.lower() for status in diagram.status],
            }
            for diagram in diagrams
        ],
        "statuses": {status.name.lower(): status.sentence for status in PoleStatus},
    }


def _plain(values: Any) -> list[float | None]:
    """Return numbers with six digits; None for those that are not finite."""
    return [float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None for value in np.asarray(values).tolist()]


if __name__ == "__main__":
    os.nice(10)  # the monitor comes first
    json.dump(answer(json.load(sys.stdin)), sys.stdout)
