from dataclasses import replace

import numpy as np
import pytest

from sprung.results.figures import subsets_figure


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


def test_a_dependence_on_the_level_is_a_line(subsets) -> None:
    trends = replace(
        subsets.level_trends,
        natural_frequency=np.array([0.05, 0.0, 0.0]),
        damping_ratio=np.array([-0.01, 0.0, 0.0]),
        p_value=np.array([1e-9, 0.5, 0.5]),
    )
    modes, _ = panels(subsets_figure(replace(subsets, level_trends=trends)))
    lines = [[line for line in upper.get_lines() if line.get_gid() == "trend"] for upper, _ in modes]
    assert [len(drawn) for drawn in lines] == [1, 0, 0]
    x, y = lines[0][0].get_data()
    frequency = subsets.modes.natural_frequency[0]
    assert (y[-1] - y[0]) / np.log2(x[-1] / x[0]) == pytest.approx(0.05 * frequency)
    (damping,) = (line for line in modes[0][1].get_lines() if line.get_gid() == "trend")
    x, y = damping.get_data()
    assert (y[-1] - y[0]) / np.log2(x[-1] / x[0]) == pytest.approx(-1.0)


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


def test_segments_of_each_subset(subsets) -> None:
    _, axes = panels(subsets_figure(subsets))
    counts = [subset.n_segments for subset in subsets.subsets]
    assert [bar.get_height() for bar in axes.containers[0]] == counts
    assert [text.get_text() for text in axes.texts] == [f"subset {k + 1}: {n}" for k, n in enumerate(counts)]


def test_without_levels_or_modes_that_is_said(chain, subsets) -> None:
    assert subsets_figure(chain).axes[0].texts[0].get_text() == "Segments were not sorted by level."
    none = replace(subsets, modes=subsets.modes.take([]), members=subsets.members[:0])
    figure = subsets_figure(none)
    assert figure.subfigs[0].axes[0].texts[0].get_text() == "No mode was identified."
    figure.draw_without_rendering()


def test_many_modes_go_into_several_bands(subsets) -> None:
    chosen = np.arange(7) % len(subsets.modes)
    many = replace(subsets, modes=subsets.modes.take(chosen), members=subsets.members[chosen], level_trends=None)
    figure = subsets_figure(many)
    assert len(panels(figure)[0]) == 7
    figure.draw_without_rendering()
