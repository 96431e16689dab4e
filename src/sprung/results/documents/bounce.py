"""Documents of bounce tests, `sprung.bounce/1`."""

from typing import Any, Literal

import numpy as np
from pydantic import Field

from sprung.bounce_tests import Bounce, BounceTest
from sprung.results.documents.document import Document, Number, Pair
from sprung.results.documents.modes import IdentifiedMode, ModeValues, identified_modes


class CoulombDocument(ModeValues):
    """Viscous damping and dry friction of a swing, apart."""

    sticking: float
    sticking_std: Number
    channel: str
    is_significant: bool


class BounceMode(IdentifiedMode):
    """A mode of one test, with its friction where that is identified separately."""

    coulomb: CoulombDocument | None = None


class BounceTestDocument(Document):
    """One push, drop or release."""

    recording: int
    onset: float
    begin: float
    end: float
    residual: float
    modes: tuple[BounceMode, ...]


class CornerEstimate(Document):
    """A spring or damper by the modes of the body."""

    value: Number
    std: Number
    relative_to_nominal: Number
    is_identifiable: bool


class BounceChangeDocument(Document):
    """Difference of one number between two series of tests, or between the sides of an axle."""

    part: str
    quantity: Literal["natural_frequency", "damping_ratio", "value", "left_over_right"]
    change: float
    interval: Pair
    score: float
    is_significant: bool


class BounceDocument(Document):
    """Modes, springs and dampers by bounce tests."""

    schema_name: Literal["sprung.bounce/1"] = Field(alias="schema")
    channels: tuple[str, ...]
    tests: tuple[BounceTestDocument, ...]
    modes: tuple[IdentifiedMode, ...]
    corners: dict[str, dict[str, CornerEstimate]]
    sides: tuple[BounceChangeDocument, ...]
    changes: tuple[BounceChangeDocument, ...]
    notes: tuple[str, ...]


def bounce_document(bounce: Bounce) -> BounceDocument:
    """Return the document of bounce tests.

    Examples
    --------
    >>> import sprung
    >>> time = np.arange(300) / 100
    >>> swing = np.exp(-0.2 * 2 * np.pi * 1.5 * time) * np.sin(2 * np.pi * 1.5 * np.sqrt(1 - 0.2**2) * time)
    >>> rest = np.zeros(300)
    >>> motion = np.concatenate([rest, swing, rest]) + 0.01 * np.random.default_rng(1).standard_normal(900)
    >>> tests = sprung.bounce(sprung.Recording(motion[None], 100.0, (sprung.Channel("acc", "acceleration"),)))
    >>> document = bounce_document(tests)
    >>> document.schema_name, round(document.modes[0].natural_frequency, 1), document.tests[0].modes[0].coulomb
    ('sprung.bounce/1', 1.5, None)
    """
    corners: dict[str, dict[str, Any]] = {}
    for value in bounce.corners:
        known = value.is_identifiable
        corners.setdefault(str(value.component.corner), {})[str(value.component.kind)] = {
            "value": value.value if known else np.nan,
            "std": value.value * value.std if known else np.nan,
            "relative_to_nominal": value.value / value.nominal if known else np.nan,
            "is_identifiable": known,
        }
    return BounceDocument.of(
        bounce,
        channels=bounce.modes.channels,
        tests=[_test(test) for test in bounce.tests],
        modes=identified_modes(bounce.modes),
        corners=corners,
    )


def _test(test: BounceTest) -> BounceTestDocument:
    modes = []
    for mode, fit in zip(identified_modes(test.modes), test.frictions, strict=True):
        coulomb = None
        if fit is not None:
            largest = int(np.argmax(np.abs(fit.amplitudes)))
            names = [name for name, entry in zip(test.modes.channels, mode.mode_shape, strict=True) if entry != 0]
            coulomb = CoulombDocument.of(
                fit,
                sticking=fit.sticking[largest],
                sticking_std=fit.friction_std * abs(fit.amplitudes[largest]),
                channel=names[largest],
            )
        modes.append(BounceMode(**{**dict(mode), "coulomb": coulomb}))
    times = {name: getattr(test.transient, name) for name in ("onset", "begin", "end")}
    return BounceTestDocument.of(test, modes=modes, **times)
