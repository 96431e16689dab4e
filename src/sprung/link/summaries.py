"""Correlations as plain values, which a box that identifies on board sends instead of samples."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from sprung._arrays import Indices, Real
from sprung.errors import FormatError, ParameterError
from sprung.identification import (
    BlockRowLadder,
    CorrelationSummary,
    IdentificationSettings,
    OrderLadder,
    Plan,
    PreparationPlan,
)
from sprung.identification.correlation import Correlations
from sprung.identification.ladders import PolynomialLadder
from sprung.identification.stabilisation import StabilityCriteria
from sprung.link.frame import plain_channels, restored_channels
from sprung.signals.harmonics import harmonic_from_dict
from sprung.signals.spectrum import Exponential, ShortPass

#: Largest size of all blocks of all averages [bytes].
_ROOM = 800_000
_LIFTERS: dict[str, Any] = {"ShortPass": ShortPass, "Exponential": Exponential}
_LADDERS: dict[str, Any] = {ladder.__name__: ladder for ladder in (OrderLadder, BlockRowLadder, PolynomialLadder)}


def summary_document(summary: CorrelationSummary) -> dict[str, Any]:
    """Return a summary as plain values and bytes: correlations in 32 bits.

    Notes
    -----
    If a message cannot hold all blocks, neighbours are averaged. The average is unchanged; standard deviations change a
    little, and with them the choice among the poles of a mode.
    """
    plan, lifter = summary.plan, summary.settings.lifter
    settings = asdict(summary.settings) | {"harmonics": None, "lifter": None if lifter is None else _named(lifter)}
    averages = [summary.average, *(correlations for _, correlations in summary.subsets if summary.method == "coss")]
    room = int(_ROOM / sum(4 * average.values.size for average in averages)) - 1
    return {
        "method": summary.method,
        "channels": plain_channels(summary.channels),
        "settings": settings,
        "plan": {
            "preparation": asdict(plan.preparation) | {"notes": []},
            "segment": plan.segment,
            "ladder": _named(plan.ladder),
            "mode_band": list(plan.mode_band),
        },
        "levels": [None if level is None else list(level) for level, _ in summary.subsets],
        "averages": [_packed(average, max(2, room)) for average in averages],
        "harmonics": [asdict(line) for line in summary.harmonics],
    }


def summary_from_document(document: Mapping[str, Any]) -> CorrelationSummary:
    """Return the summary that plain values and bytes describe.

    Raises
    ------
    FormatError
        If it is incomplete or invalid.
    """
    try:
        stated = dict(document["plan"])
        preparation = dict(stated["preparation"])
        settings = dict(document["settings"])
        ladder = settings["ladder"]
        lifter = settings["lifter"]
        settings |= {
            "lifter": None if lifter is None else _LIFTERS[lifter[0]](**lifter[1]),
            "criteria": StabilityCriteria(**settings["criteria"]),
            "band": _tuple(settings["band"]),
            "references": _tuple(settings["references"]),
            "ladder": None if ladder is None else BlockRowLadder(**ladder),
        }
        preparation |= {
            "channels": tuple(preparation["channels"]),
            "factors": {name: float(factor) for name, factor in preparation["factors"].items()},
            "band": _pair(preparation["band"]),
            "notes": (),
        }
        plan = Plan(
            preparation=PreparationPlan(**preparation),
            segment=float(stated["segment"]),
            ladder=_LADDERS[stated["ladder"][0]](**stated["ladder"][1]),
            mode_band=_pair(stated["mode_band"]),
        )
        averages = [_unpacked(stored) for stored in document["averages"]]
        levels = [_tuple(level) for level in document["levels"]]
        correlations = averages[1:] if document["method"] == "coss" else averages
        return CorrelationSummary(
            method=str(document["method"]),
            settings=IdentificationSettings(**settings),
            plan=plan,
            channels=restored_channels(document["channels"]),
            subsets=tuple(zip(levels, correlations, strict=True)),
            average=averages[0],
            harmonics=tuple(map(harmonic_from_dict, document["harmonics"])),
        )
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, ParameterError) as error:
        raise FormatError(f"incomplete or invalid correlations: {error}") from None


def _packed(correlations: Correlations, n_blocks: int) -> dict[str, Any]:
    """Return correlations with their blocks averaged to a given number of blocks, in 32 bits."""
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
        "n_products": correlations.n_products,
    }


def _mean(correlations: Correlations, rows: Indices) -> Real:
    weights = correlations.weights[rows]
    if not weights.sum():
        return correlations.blocks[rows].mean(axis=0)
    return np.tensordot(weights / weights.sum(), correlations.blocks[rows], axes=1)


def _unpacked(stored: Mapping[str, Any]) -> Correlations:
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
        n_products=float(stored["n_products"]),
    )


def _named(value: Any) -> list[Any]:
    """Return the name of a class and the fields of its instance."""
    return [type(value).__name__, asdict(value)]


def _pair(values: Sequence[Any]) -> tuple[float, float]:
    """Return two numbers."""
    return float(values[0]), float(values[1])


def _tuple(values: Sequence[Any] | None) -> Any:
    """Return a tuple; None stays."""
    return None if values is None else tuple(values)
