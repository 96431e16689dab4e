"""Modes and correlations as plain values: what a box that identifies on board sends instead of samples."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from sprung._arrays import Indices, Real
from sprung.errors import FormatError, ParameterError
from sprung.identification import CorrelationSummary, IdentificationSettings, Plan
from sprung.identification.correlation import Correlations
from sprung.identification.stabilisation import StabilityCriteria
from sprung.modal import Modes
from sprung.recording import Channel
from sprung.signals.cepstrum import Exponential, ShortPass
from sprung.signals.harmonics import harmonic_from_dict

#: Most bytes of all blocks of all averages.
_ROOM = 800_000
_LIFTERS: dict[str, Any] = {"ShortPass": ShortPass, "Exponential": Exponential}


def mode_documents(modes: Modes) -> list[dict[str, Any]]:
    """Return modes as plain values, one object for each: the fields of a mode that every method has."""
    return [
        {
            "natural_frequency": float(modes.natural_frequency[k]),
            "natural_frequency_std": _number(modes.natural_frequency_std[k]),
            "damping_ratio": float(modes.damping_ratio[k]),
            "damping_ratio_std": _number(modes.damping_ratio_std[k]),
            "mode_shape": {"real": modes.mode_shapes[k].real.tolist(), "imag": modes.mode_shapes[k].imag.tolist()},
            "label": modes.labels[k],
            "stable_rate": float(modes.stable_rate[k]),
        }
        for k in range(len(modes))
    ]


def summary_document(summary: CorrelationSummary) -> dict[str, Any]:
    """Return a summary as plain values and bytes: correlations in 32 bits.

    Notes
    -----
    Where a message would not hold all blocks, neighbours are averaged. The average stays; standard deviations change a
    little, and with them the choice among the poles of a mode.
    """
    plan, settings = summary.plan, asdict(summary.plan.settings) | {"harmonics": None}
    lifter: Any = summary.plan.settings.lifter
    averages = [summary.average, *(one for _, one in summary.subsets if summary.method == "coss")]
    room = int(_ROOM / sum(4 * one.values.size for one in averages)) - 1
    return {
        "method": summary.method,
        "channels": [[c.name, c.quantity, c.position, c.direction] for c in summary.channels],
        "plan": {
            "channels": list(plan.channels),
            "speed": plan.speed,
            "factors": [[name, factor] for name, factor in plan.factors.items()],
            "sampling_rate": plan.sampling_rate,
            "settings": settings | {"lifter": None if lifter is None else [type(lifter).__name__, asdict(lifter)]},
            "band": list(plan.band),
            "spectrum_segment": plan.spectrum_segment,
        },
        "levels": [None if level is None else list(level) for level, _ in summary.subsets],
        "averages": [_packed(one, max(2, room)) for one in averages],
        "harmonics": [asdict(line) for line in summary.harmonics],
    }


def summary_from_document(document: Mapping[str, Any]) -> CorrelationSummary:
    """Return the summary of plain values and bytes.

    Raises
    ------
    FormatError
        Where it is incomplete or invalid.
    """
    try:
        stated = dict(document["plan"])
        settings = dict(stated["settings"])
        lifter = settings["lifter"]
        settings |= {
            "lifter": None if lifter is None else _LIFTERS[lifter[0]](**lifter[1]),
            "criteria": StabilityCriteria(**settings["criteria"]),
            "band": _tuple(settings["band"]),
            "references": _tuple(settings["references"]),
            "row_ladder": _tuple(settings["row_ladder"]),
        }
        plan = Plan(
            channels=tuple(stated["channels"]),
            speed=stated["speed"],
            factors={name: float(factor) for name, factor in stated["factors"]},
            sampling_rate=float(stated["sampling_rate"]),
            settings=IdentificationSettings(**settings),
            band=(float(stated["band"][0]), float(stated["band"][1])),
            spectrum_segment=float(stated["spectrum_segment"]),
            notes=(),
        )
        averages = [_unpacked(one) for one in document["averages"]]
        levels = [_tuple(level) for level in document["levels"]]
        correlations = averages[1:] if document["method"] == "coss" else averages
        return CorrelationSummary(
            method=str(document["method"]),
            plan=plan,
            channels=tuple(
                Channel(name, quantity, _tuple(position), _tuple(direction))
                for name, quantity, position, direction in document["channels"]
            ),
            subsets=tuple(zip(levels, correlations, strict=True)),
            average=averages[0],
            harmonics=tuple(map(harmonic_from_dict, document["harmonics"])),
        )
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, ParameterError) as error:
        raise FormatError(f"incomplete or invalid correlations: {error}") from None


def _packed(correlations: Correlations, n_blocks: int) -> dict[str, Any]:
    """Return correlations with their blocks averaged to a number, in 32 bits."""
    groups = np.array_split(np.arange(len(correlations.weights)), min(n_blocks, len(correlations.weights)))
    weights = np.array([correlations.weights[rows].sum() for rows in groups])
    blocks = np.array([_mean(correlations, rows) for rows in groups])
    return {
        "shape": list(blocks.shape),
        "values": correlations.values.astype("<f4").tobytes(),
        "blocks": blocks.astype("<f4").tobytes(),
        "weights": weights.tolist(),
        "sampling_rate": correlations.sampling_rate,
        "channels": list(correlations.channels),
        "references": list(correlations.references),
        "n_segments": correlations.n_segments,
    }


def _mean(correlations: Correlations, rows: Indices) -> Real:
    """Return the mean of blocks."""
    weights = correlations.weights[rows]
    if not weights.sum():
        return correlations.blocks[rows].mean(axis=0)
    return np.tensordot(weights / weights.sum(), correlations.blocks[rows], axes=1)


def _unpacked(stored: Mapping[str, Any]) -> Correlations:
    """Return correlations."""
    blocks = np.frombuffer(stored["blocks"], dtype="<f4").reshape(stored["shape"]).astype(np.float64)
    weights = np.array(stored["weights"], dtype=np.float64)
    return Correlations(
        values=np.frombuffer(stored["values"], dtype="<f4").reshape(blocks.shape[1:]).astype(np.float64),
        blocks=blocks,
        weights=weights / weights.sum(),
        sampling_rate=float(stored["sampling_rate"]),
        channels=tuple(stored["channels"]),
        references=tuple(stored["references"]),
        n_segments=int(stored["n_segments"]),
    )


def _tuple(values: Sequence[Any] | None) -> Any:
    """Return a tuple; None stays."""
    return None if values is None else tuple(values)


def _number(value: float) -> float | None:
    """Return a finite number; None for any other."""
    return float(value) if np.isfinite(value) else None
