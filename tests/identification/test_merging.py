"""Merging of the modes of several parts."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.identification.stabilisation import merge_modes
from sprung.modal import Modes, mac


def pole(frequency, damping=0.02):
    return 2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2))


def modes_of(*rows, std=0.01, channels=("a", "b")):
    """Modes from (frequency, damping, shape)."""
    n = len(rows)
    return Modes(
        poles=np.array([pole(row[0], row[1]) for row in rows]),
        mode_shapes=np.array([row[2] for row in rows], dtype=complex).reshape(n, len(channels)),
        channels=channels,
        natural_frequency_std=np.full(n, std),
        damping_ratio_std=np.full(n, std / 10),
        stable_rate=np.full(n, 0.5),
        labels=(None,) * n,
    )


def test_modes_of_parts_merge_with_weights_and_each_part_keeps_its_own() -> None:
    """Damping differs between the subsets of one mode, frequency and shape do not."""
    parts = [
        modes_of((3.0, 0.020, (1, 0.5)), (9.0, 0.05, (1, -1))),
        modes_of((9.1, 0.04, (1, -1)), std=0.02),
        modes_of((3.01, 0.011, (1, 0.51)), (9.05, 0.045, (1, -1.1)), (20.0, 0.01, (1, 1))),
    ]
    merged = merge_modes(parts, weights=[1.0, 2.0, 5.0])
    assert merged.members.tolist() == [[0, -1, 0], [1, 0, 1]]
    poles = [(parts[0].poles[0] + 5 * parts[2].poles[0]) / 6]
    poles.append((parts[0].poles[1] + 2 * parts[1].poles[0] + 5 * parts[2].poles[1]) / 8)
    np.testing.assert_allclose(merged.modes.poles, poles)
    np.testing.assert_allclose(merged.modes.mode_shapes, parts[2].mode_shapes[:2])
    deviations = [np.hypot(0.01, 0.05) / 6, np.sqrt(0.01**2 + 0.04**2 + 0.05**2) / 8]
    np.testing.assert_allclose(merged.modes.natural_frequency_std, deviations)
    assert merged.modes.stable_rate.tolist() == [0.5, 0.5]


@pytest.mark.parametrize(("stds", "weights"), [((np.nan, np.nan), [3.0, 1.0]), ((0.01, 0.01 * np.sqrt(3)), [1.0, 1.0])])
def test_shapes_can_be_averaged_whatever_their_phase_and_scale(stds, weights) -> None:
    """Weights are the inverse variances where these are known."""
    parts = [modes_of((3.0, 0.02, (1, 0.5)), std=stds[0]), modes_of((3.0, 0.02, (2j, 1.2j)), std=stds[1])]
    merged = merge_modes(parts, weights=weights, has_mean_shapes=True)
    assert merged.shares == pytest.approx(np.array([[0.75, 0.25]]))
    scaled = np.array([1.0, 0.6]) * 1.25 / 1.3
    expected = 0.75 * np.array([1.0, 0.5]) + 0.25 * scaled
    np.testing.assert_allclose(merged.modes.mode_shapes, [expected / expected[0]])


def test_a_mode_of_less_than_half_of_the_parts_is_left_out() -> None:
    one, none = modes_of((3.0, 0.02, (1, 1))), modes_of((3.0, 0.02, (1, 1))).take(np.zeros(0, dtype=int))
    assert len(merge_modes([one, none], weights=[1, 1]).modes) == 1
    assert len(merge_modes([one, none, none], weights=[1, 1, 1]).modes) == 0
    assert merge_modes([one, none, none], weights=[1, 1, 1]).members.shape == (0, 3)
    assert merge_modes([none], weights=[1]).members.shape == (0, 1)


def test_merged_modes_come_by_rising_frequency() -> None:
    part = modes_of((9.0, 0.02, (1, 1)), (3.0, 0.02, (1, -1)), (5.0, 0.02, (1, 0)))
    merged = merge_modes([part, part.take(np.array([2, 0, 1]))], weights=[1, 1])
    np.testing.assert_allclose(merged.modes.natural_frequency, [3.0, 5.0, 9.0])
    assert merged.members.tolist() == [[1, 2], [2, 0], [0, 1]]


def test_close_modes_of_different_shape_do_not_merge() -> None:
    parts = [modes_of((3.0, 0.02, (1, 1)), (3.02, 0.02, (1, -1)))] * 2
    merged = merge_modes(parts, weights=[1, 1])
    assert merged.members.tolist() == [[0, 0], [1, 1]]
    np.testing.assert_allclose(np.diag(mac(merged.modes.mode_shapes, parts[0].mode_shapes)), 1)


def test_of_two_modes_of_one_part_that_merge_the_more_stable_one_stands_for_it() -> None:
    twins = replace(modes_of((3.0, 0.02, (1, 1)), (3.01, 0.03, (1, 1))), stable_rate=np.array([0.3, 0.8]))
    merged = merge_modes([twins], weights=[1])
    assert merged.members.tolist() == [[1]]
    np.testing.assert_allclose(merged.modes.poles, twins.poles[1:])


def test_one_part_merges_to_itself() -> None:
    part = modes_of((3.0, 0.02, (1, 1)), (9.0, 0.05, (1, -1)))
    merged = merge_modes([part], weights=[7])
    np.testing.assert_allclose(merged.modes.poles, part.poles)
    np.testing.assert_allclose(merged.modes.natural_frequency_std, part.natural_frequency_std)
    assert merged.members.tolist() == [[0], [1]]
