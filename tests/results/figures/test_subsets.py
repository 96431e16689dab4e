"""Modes of subsets: values over the level, MAC, rates of stable points."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes

from sprung._arrays import Real
from sprung.results.figures import alignment_rates, mac_figure, stable_rates_figure, subsets_figure


def matrix(axes: Axes) -> Real:
    (image,) = axes.get_images()
    return np.asarray(image.get_array())


def printed(axes: Axes) -> Real:
    texts = [text for text in axes.texts if text.get_gid() == "value"]
    side = round(np.sqrt(len(texts)))
    values = np.full((side, side), np.nan)
    for text in texts:
        column, row = text.get_position()
        values[round(row), round(column)] = float(text.get_text())
    return values


def test_values_of_the_modes(chain) -> None:
    axes = mac_figure(chain).axes[0]
    shapes = chain.modes.mode_shapes
    products = np.abs(shapes.conj() @ shapes.T) ** 2
    expected = products / np.outer(np.diag(products), np.diag(products)) ** 0.5
    np.testing.assert_allclose(matrix(axes), expected, atol=1e-12)
    np.testing.assert_allclose(printed(axes), expected, atol=0.0051)
    assert axes.get_yticklabels()[0].get_text() == f"1\n{chain.modes.natural_frequency[0]:.2f} Hz"


def test_very_many_modes_have_no_printed_values(chain) -> None:
    many = chain.modes.take(np.arange(30) % 3)
    figure = mac_figure(replace(chain, modes=many, members=np.full((30, 1), -1)))
    assert matrix(figure.axes[0]).shape == (30, 30)
    assert not [text for text in figure.axes[0].texts if text.get_gid() == "value"]
    figure.draw_without_rendering()


@pytest.mark.parametrize("result", ["chain", "subsets"])
def test_no_mode_is_said(result, request: pytest.FixtureRequest) -> None:
    identification = request.getfixturevalue(result)
    none = replace(identification, modes=identification.modes.take([]), members=identification.members[:0])
    assert mac_figure(none).axes[0].texts[0].get_text() == "No mode was identified."


def panels(figure):
    """Upper and lower panel of each mode, and the panel of the segments."""
    above = figure.subfigs[0].axes
    upper = [axes for axes in above if axes.get_title()]
    lower = [axes for axes in above if axes.get_xlabel() == "Level [-]"]
    return list(zip(upper, lower, strict=True)), figure.subfigs[1].axes[0]


def test_values_and_intervals_stand_at_the_levels(subsets) -> None:
    modes, _ = panels(subsets_figure(subsets))
    assert len(modes) == len(subsets.modes)
    levels = np.array([subset.level for subset in subsets.subsets])
    for k, (upper, lower) in enumerate(modes):
        found = np.flatnonzero(subsets.members[k] >= 0)
        for axes, name, factor in ((upper, "natural_frequency", 1), (lower, "damping_ratio", 100)):
            parts = [(subsets.subsets[j].modes, subsets.members[k, j]) for j in found]
            values = [factor * getattr(part, name)[m] for part, m in parts]
            spreads = [factor * getattr(part, f"{name}_std")[m] for part, m in parts]
            (container,) = axes.containers
            points, _, (along, upright) = container
            np.testing.assert_allclose(points.get_xdata(), levels[found].mean(axis=1))
            np.testing.assert_allclose(points.get_ydata(), values)
            np.testing.assert_allclose([s[:, 0] for s in along.get_segments()], levels[found])
            half = [np.ptp(s[:, 1]) / 2 for s in upright.get_segments()]
            np.testing.assert_allclose(half, 1.96 * np.array(spreads))
            merged = next(line for line in axes.get_lines() if line.get_gid() == "merged").get_ydata()[0]
            assert merged == pytest.approx(factor * getattr(subsets.modes, name)[k])


def test_small_changes_look_small(subsets) -> None:
    for upper, lower in panels(subsets_figure(subsets))[0]:
        assert np.ptp(upper.get_ylim()) >= 0.04 * np.mean(upper.get_ylim()) * 0.95
        assert np.ptp(lower.get_ylim()) >= 0.4 * np.mean(lower.get_ylim()) * 0.7


def test_a_mode_that_a_subset_lacks_is_a_cross_on_the_axis(subsets) -> None:
    members = subsets.members.copy()
    members[1, 0] = -1
    modes, _ = panels(subsets_figure(replace(subsets, members=members)))
    crosses = [[line for line in upper.get_lines() if line.get_gid() == "not found"] for upper, _ in modes]
    assert [len(lines) for lines in crosses] == [0, 1, 0]
    assert crosses[1][0].get_xdata()[0] == pytest.approx(np.mean(subsets.subsets[0].level))


def test_without_levels_or_modes_that_is_said(chain, subsets) -> None:
    assert subsets_figure(chain).axes[0].texts[0].get_text() == "Segments were not sorted by level."
    none = replace(subsets, modes=subsets.modes.take([]), members=subsets.members[:0])
    figure = subsets_figure(none)
    assert figure.subfigs[0].axes[0].texts[0].get_text() == "No mode was identified."
    figure.draw_without_rendering()


@pytest.mark.slow
def test_many_modes_go_into_several_bands(subsets) -> None:
    chosen = np.arange(7) % len(subsets.modes)
    many = replace(subsets, modes=subsets.modes.take(chosen), members=subsets.members[chosen], level_trends=None)
    figure = subsets_figure(many)
    assert len(panels(figure)[0]) == 7
    figure.draw_without_rendering()


def test_rates_are_those_of_the_modes(chain) -> None:
    frequency, rate = alignment_rates(chain.subsets[0])
    for mode in range(len(chain.modes)):
        near = np.argmin(np.abs(frequency - chain.modes.natural_frequency[mode]))
        assert rate[near] == pytest.approx(chain.modes.stable_rate[mode], abs=0.05)
    figure = stable_rates_figure(chain, threshold=0.5)
    assert figure.axes[0].get_ylim()[0] == 0
