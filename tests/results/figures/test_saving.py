import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.image import imread

from sprung.errors import ParameterError
from sprung.results.figures import figures, save_figures

ALWAYS = {"stabilisation.png", "spectra.png"}
OF_MODES = {"mode_shapes.png", "complexity.png", "mac.png"}


def check(paths, directory, names):
    assert {path.name for path in paths} == names
    for path in paths:
        assert path.parent == directory
        picture = imread(path)
        assert min(picture.shape[:2]) > 300
        assert 0.01 < np.mean(picture[..., :3].min(axis=-1) < 0.95) < 0.9


@pytest.mark.slow
def test_all_pictures_of_a_record_are_written(chain_with_lines, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "figures"
    check(save_figures(chain_with_lines, folder, source="run.csv"), folder, ALWAYS | OF_MODES)


@pytest.mark.slow
def test_edited_spectra_are_written(edited, tmp_path: Path) -> None:
    check(save_figures(edited, str(tmp_path)), tmp_path, ALWAYS | OF_MODES)


def test_one_channel_has_no_shapes(single, tmp_path: Path) -> None:
    assert len(single.modes) == 3
    check(save_figures(single, tmp_path), tmp_path, ALWAYS)


def test_without_modes_there_are_no_shapes(chain, tmp_path: Path) -> None:
    none = replace(chain, modes=chain.modes.take([]), members=chain.members[:0])
    check(save_figures(none, tmp_path), tmp_path, ALWAYS)
    assert "No mode was identified." in figures(none)["spectra"].get_suptitle()


@pytest.mark.slow
def test_figures_of_a_car_are_written(car, tmp_path: Path) -> None:
    assert {"bounce", "pitch", "roll"} <= set(car.modes.labels)
    check(save_figures(car, tmp_path), tmp_path, ALWAYS | OF_MODES | {"subsets.png"})


def test_headings_name_the_source_and_the_method(chain) -> None:
    for name, figure in figures(chain, source="run.csv").items():
        heading = figure.get_suptitle()
        assert "run.csv" in heading, name
    assert "Cov-SSI of acc_1, acc_2, acc_3 at 125 Hz" in figures(chain)["stabilisation"].get_suptitle()


@pytest.mark.slow
def test_no_global_state_of_matplotlib_is_touched(chain) -> None:
    before = matplotlib.rcParams.copy()
    for figure in figures(chain).values():
        figure.draw_without_rendering()
    assert matplotlib.rcParams.copy() == before
    code = "import sys, sprung.results.figures; sys.exit('matplotlib.pyplot' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_another_format_is_refused(single, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"^file_format 'gif' is not one of pdf, png, svg$"):
        save_figures(single, tmp_path / "new", file_format="gif")
    assert not (tmp_path / "new").exists()
