"""Hypotheses of a change: which parts they move, and their prior shares."""

import numpy as np
import pytest

from sprung.diagnosis.hypotheses import Hypothesis, hypotheses_of, log_prior
from sprung.vehicles import Component, read_vehicle, structure

CORNERS = ("front_left", "front_right", "rear_left", "rear_right")
COMPONENTS = tuple(structure(read_vehicle("zafira")).components())
PAIR = Hypothesis("pair", "front_left", "tyre", Component("rear_right", "damper"))


def test_a_car_has_one_hypothesis_per_part_axle_and_kind_and_one_more() -> None:
    """Twelve parts, two axles and all corners of three kinds, an unmodelled change, and each pair of the parts once."""
    names = [hypothesis.name for hypothesis in hypotheses_of(COMPONENTS)]
    assert len(set(names)) == len(names) == 12 + 6 + 3 + 1 + 66
    assert names[0] == "front_left.spring"
    assert {"front.damper", "rear.tyre", "all.spring"} <= set(names)
    assert names[21:23] == ["unmodelled", "front_left.spring+front_left.damper"]


@pytest.mark.parametrize(
    ("hypothesis", "parts"),
    [
        (Hypothesis("single", "rear_left", "damper"), ["rear_left.damper"]),
        (Hypothesis("axle", "front", "tyre"), ["front_left.tyre", "front_right.tyre"]),
        (Hypothesis("all", "all", "spring"), [f"{corner}.spring" for corner in CORNERS]),
        (Hypothesis("else", "vehicle", "unmodelled"), []),
        (
            Hypothesis("pair", "front_left", "tyre", Component("rear_right", "damper")),
            ["front_left.tyre", "rear_right.damper"],
        ),
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
    assert shares[:12] == pytest.approx(np.full(12, 0.78 / (12 + 66 * np.exp(-3))))
    assert shares[21] == pytest.approx(0.05)
    assert shares[22:] == pytest.approx(np.full(66, np.exp(-3) * shares[0]))


def test_a_pair_is_two_changes_and_an_unmodelled_one_none() -> None:
    assert [change.name for change in PAIR.changes] == ["front_left.tyre", "rear_right.damper"]
    assert PAIR.name == "front_left.tyre+rear_right.damper"
    assert PAIR.directions(COMPONENTS).sum(axis=1).tolist() == [1, 1]
    assert PAIR.directions(COMPONENTS).sum(axis=0).tolist() == PAIR.direction(COMPONENTS).tolist()
    assert Hypothesis("else", "vehicle", "unmodelled").directions(COMPONENTS).shape == (0, 12)


def test_an_anti_roll_bar_changes_alone() -> None:
    bars = (Component("front_axle", "anti_roll"), Component("rear_axle", "anti_roll"))
    names = [hypothesis.name for hypothesis in hypotheses_of((*COMPONENTS, *bars)) if hypothesis.scope != "pair"]
    assert len(names) == len(set(names)) == 12 + 2 + 6 + 3 + 1
    assert [name for name in names if "anti_roll" in name] == ["front_axle.anti_roll", "rear_axle.anti_roll"]
