"""Animated mode shapes: what moves, the pictures of a GIF, and a page that needs nothing else."""

import json
import re

import numpy as np
import pytest
from PIL import Image, ImageSequence

from sprung.errors import ParameterError
from sprung.modal import Modes
from sprung.recording import Channel
from sprung.results.figures.animation import animated_figure, animation_page, save_animation, scene_of
from sprung.results.figures.draw import STYLE

Z = (0.0, 0.0, 1.0)
CORNERS = ((1.2, 0.7, 0.0), (1.2, -0.7, 0.0), (-1.2, -0.7, 0.0), (-1.2, 0.7, 0.0))
BODY = tuple(Channel(f"acc_{k}", "acceleration", corner, Z) for k, corner in enumerate(CORNERS))
MAST = tuple(Channel(f"level {k}", "acceleration", (0.0, 0.0, 4.0 * k), (1.0, 0.0, 0.0)) for k in range(1, 5))
BARE = tuple(Channel(f"<b>&{k}") for k in range(3))


def modes_of(channels, n_modes=2):
    """Return complex modes: a bounce, and a shape whose channels move a quarter of a cycle apart."""
    shapes = np.ones((n_modes, len(channels)), dtype=np.complex128)
    shapes[1:] = np.exp(0.5j * np.pi * np.arange(len(channels)))
    return Modes(
        poles=np.asarray(2 * np.pi * np.arange(1, n_modes + 1) * (1j - 0.05), dtype=np.complex128),
        mode_shapes=shapes,
        channels=tuple(channel.name for channel in channels),
        natural_frequency_std=np.full(n_modes, 0.012),
        damping_ratio_std=np.array([0.003, *[np.nan] * (n_modes - 1)]),
        stable_rate=np.ones(n_modes),
        labels=("bounce", *(None,) * (n_modes - 1)),
    )


def test_a_rigid_body_is_a_plate_with_its_sensors() -> None:
    scene = scene_of(modes_of(BODY), BODY)
    assert scene.face == (0, 1, 2, 3)
    assert scene.names == ("", "", "", "", *(channel.name for channel in BODY))
    assert scene.motions[0] == pytest.approx(np.tile([0, 0, 1.0], (8, 1)), abs=1e-12)
    assert "x points forward" in scene.remark


def test_a_structure_is_nodes_with_lines_between_neighbours() -> None:
    scene = scene_of(modes_of(MAST), MAST)
    assert scene.lines.tolist() == [[0, 1], [1, 2], [2, 3]]
    assert scene.motions[0] == pytest.approx(np.tile([1.0, 0, 0], (4, 1)))
    assert np.abs(scene.scaled_motions()).max() == pytest.approx(0.14 * 12.0)
    assert scene.face == ()


def test_channels_without_positions_stand_side_by_side() -> None:
    channels = (*BARE, Channel("rate", "angular_velocity"))
    scene = scene_of(modes_of(channels), channels)
    assert scene.positions.tolist() == [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
    assert not scene.has_metres
    assert scene.remark == "Positions are unknown: channels stand side by side. Not drawn: rate."


def test_points_move_by_the_real_part_of_the_turning_shape() -> None:
    modes = modes_of(MAST)
    scene = scene_of(modes, MAST)
    figure, update = animated_figure(modes, scene)
    for frame in (0, 5, 18):
        update(frame)
        points = figure.axes[1].lines[-1].get_xydata()
        phase = np.exp(2j * np.pi * frame / STYLE.frames)
        expected = scene.flat(scene.positions + (scene.scaled_motions()[1] * phase).real)
        assert np.asarray(points) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    "channels", [BODY, pytest.param(MAST, marks=pytest.mark.slow), pytest.param(BARE, marks=pytest.mark.slow)]
)
def test_a_gif_has_all_frames_and_no_two_are_the_same(tmp_path, channels) -> None:
    save_animation(modes_of(channels), channels, tmp_path / "shapes.gif", source="run.csv")
    with Image.open(tmp_path / "shapes.gif") as picture:
        assert picture.info["loop"] == 0
        frames = [np.asarray(frame.convert("L"), dtype=float) for frame in ImageSequence.Iterator(picture)]
    assert len(frames) == STYLE.frames
    quarter = STYLE.frames // 4
    assert np.abs(frames[0] - frames[quarter]).max() > 50
    assert 0.005 < np.mean(frames[0] < 240) < 0.9


def test_titles_have_units_and_known_deviations() -> None:
    modes = modes_of(MAST)
    figure, _ = animated_figure(modes, scene_of(modes, MAST), source="run.csv")
    titles = [axes.get_title() for axes in figure.axes]
    assert titles[0] == "Mode 1 bounce\n1.00 ± 0.01 Hz, damping 4.99 ± 0.3 %"
    assert titles[1] == "Mode 2\n2.00 ± 0.01 Hz, damping 4.99 %"
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert {"x", "y", "z", "2 m each", "level 1"} <= set(texts)


def test_a_page_holds_everything_and_escapes_names() -> None:
    modes = modes_of(BARE)
    page = animation_page(modes, scene_of(modes, BARE), source="<run>&.csv")
    assert not re.search(r"(?:src|href)=|https?://|@import|url\(", page)
    assert "<b>" not in page
    assert "<run>" not in page
    assert "Mode shapes: &lt;run&gt;&amp;.csv" in page
    content = json.loads(re.findall(r'<script type="application/json" id="content">(.*?)</script>', page, re.S)[0])
    assert content["names"] == [channel.name for channel in BARE]
    motions = np.array(content["modes"][1]["real"]) + 1j * np.array(content["modes"][1]["imag"])
    assert motions == pytest.approx(scene_of(modes, BARE).scaled_motions()[1], abs=1e-9)


def test_other_endings_and_nothing_to_draw(tmp_path) -> None:
    with pytest.raises(ParameterError, match=r"animations are \.gif or \.html"):
        save_animation(modes_of(MAST), MAST, tmp_path / "shapes.mp4")
    with pytest.raises(ParameterError, match="there is no mode to animate"):
        save_animation(modes_of(MAST).take(np.zeros(0, dtype=np.intp)), MAST, tmp_path / "shapes.gif")
    rates = (Channel("a", "angular_velocity"), Channel("b", "angular_velocity"))
    with pytest.raises(ParameterError, match="no channel can be drawn"):
        save_animation(modes_of(rates), rates, tmp_path / "shapes.gif")
