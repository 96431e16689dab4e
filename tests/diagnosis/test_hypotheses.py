"""Hypotheses of a change: which parts they move, and their prior shares."""

import numpy as np
import pytest

from sprung.diagnosis.hypotheses import Hypothesis, hypotheses_of, log_prior
from sprung.vehicles import Component

CORNERS = ("front_left", "front_right", "rear_left", "rear_right")
COMPONENTS = tuple(Component(corner, kind) for corner in CORNERS for kind in ("spring", "damper", "tyre"))


def test_a_car_has_one_hypothesis_per_part_axle_and_kind_and_one_more() -> None:
    """Twelve parts, two axles and all corners of three kinds, and an unmodelled change."""
    names = [hypothesis.name for hypothesis in hypotheses_of(COMPONENTS)]
    assert len(set(names)) == len(names) == 12 + 6 + 3 + 1
    assert names[0] == "front_left.spring"
    assert {"front.damper", "rear.tyre", "all.spring"} <= set(names)
    assert names[-1] == "unmodelled"


@pytest.mark.parametrize(
    ("hypothesis", "parts"),
    [
        (Hypothesis("single", "rear_left", "damper"), ["rear_left.damper"]),
        (Hypothesis("axle", "front", "tyre"), ["front_left.tyre", "front_right.tyre"]),
        (Hypothesis("all", "all", "spring"), [f"{corner}.spring" for corner in CORNERS]),
        (Hypothesis("else", "vehicle", "unmodelled"), []),
    ],
)
def test_a_hypothesis_moves_its_parts_only(hypothesis, parts) -> None:
    assert [str(component) for component in hypothesis.parts(COMPONENTS)] == parts
    moved = hypothesis.direction(COMPONENTS)
    assert [str(component) for component, is_moved in zip(COMPONENTS, moved, strict=True) if is_moved] == parts
    assert set(moved) <= {0.0, 1.0}


def test_prior_shares_sum_to_one_and_are_equal_within_a_scope() -> None:
    hypotheses = hypotheses_of(COMPONENTS)
    shares = np.exp(log_prior(hypotheses))
    assert shares.sum() == pytest.approx(1.0)
    assert shares[:12] == pytest.approx(np.full(12, 0.78 / 12))
    assert shares[-1] == pytest.approx(0.05)
