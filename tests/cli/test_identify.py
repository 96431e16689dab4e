import json
import math
from pathlib import Path

import numpy as np
import pytest

from sprung.formats import read, write
from sprung.identification import cov_ssi
from sprung.modal import mac
from sprung.recording import Channel, Recording


def shape_of(mode):
    return np.array(mode["mode_shape"]["real"]) + 1j * np.array(mode["mode_shape"]["imag"])


def test_simulated_chain_is_identified_with_its_truth(sprung, chain):
    result = sprung("identify", chain, "--json", "-").document()
    true = json.loads(Path(f"{chain}.truth.json").read_text(encoding="utf-8"))
    assert len(result["modes"]) == len(true["modes"]) == 3
    for mode, truth in zip(result["modes"], true["modes"], strict=True):
        assert mode["natural_frequency"] == pytest.approx(truth["natural_frequency"], rel=0.01)
        assert abs(mode["natural_frequency"] - truth["natural_frequency"]) < 4 * mode["natural_frequency_std"]
        assert abs(mode["damping_ratio"] - truth["damping_ratio"]) < 4 * mode["damping_ratio_std"]
        assert mac(shape_of(mode)[None], shape_of(truth)[None])[0, 0] > 0.99


def test_command_line_gives_what_the_library_gives(sprung, chain):
    ours = cov_ssi(read(chain)).modes
    modes = sprung("identify", chain, "--json", "-").document()["modes"]
    np.testing.assert_array_equal([mode["natural_frequency"] for mode in modes], ours.natural_frequency)
    np.testing.assert_array_equal([mode["damping_ratio_std"] for mode in modes], ours.damping_ratio_std)
    np.testing.assert_array_equal([shape_of(mode) for mode in modes], ours.mode_shapes)


@pytest.mark.parametrize(
    ("words", "name", "value"),
    [
        (["--band", "2", "60"], "band", [2.0, 60.0]),
        (["--decimate-to", "100"], "decimate_to", 100.0),
        (["--segment", "2.5"], "segment", 2.5),
        (["--block-rows", "31"], "block_rows", 31),
        (["--max-order", "24"], "max_order", 24),
        (["--method", "coss", "--subsets", "2"], "n_subsets", 2),
        (["--references", "acc_3,acc_1"], "references", ["acc_3", "acc_1"]),
        (["--references", "disjoint"], "has_disjoint_references", True),
        (["--cepstrum", "2"], "lifter", {"kind": "ShortPass", "length": 2.0}),
        (["--thesis"], "ladder", {"first": 12, "last": 45}),
        (["--thesis", "--block-rows", "30"], "ladder", {"first": 12, "last": 30}),
    ],
)
def test_options_reach_the_settings(sprung, chain, words, name, value):
    assert sprung("identify", chain, *words, "--json", "-").document()["settings"][name] == value


def test_sampling_rate_is_stated_for_files_without_time(sprung, chain, tmp_path):
    np.save(tmp_path / "run.npy", read(chain).samples.T)
    words = ("identify", tmp_path / "run.npy", "--json", "-")
    refused = sprung(*words)
    assert (refused.code, refused.out) == (2, "")
    modes = sprung(*words, "--sampling-rate", "200").document()["modes"]
    known = sprung("identify", chain, "--json", "-").document()["modes"]
    assert [mode["natural_frequency"] for mode in modes] == pytest.approx(
        [mode["natural_frequency"] for mode in known], rel=1e-6
    )


def test_no_pole_at_all_is_named(sprung, chain):
    outcome = sprung("identify", chain, "--max-order", "2")
    assert outcome.code == 3
    assert "--max-order" in outcome.err or "poles" in outcome.err


def test_unknown_uncertainty_is_null(sprung, chain):
    modes = sprung("identify", chain, "--segment", "1e6", "--no-refine", "--json", "-").document()["modes"]
    assert modes
    assert all(mode["natural_frequency_std"] is None for mode in modes)
    assert "nan" not in sprung("identify", chain, "--segment", "1e6", "--no-refine").out


@pytest.mark.slow
def test_large_files_are_read_in_blocks(sprung, chain, monkeypatch):
    whole = sprung("identify", chain, "--json", "-").document()["modes"]
    monkeypatch.setattr("sprung.formats.LARGE", 10_000)
    monkeypatch.setattr("sprung.formats.BLOCK_SAMPLES", 6_000)
    modes = sprung("identify", chain, chain, "--json", "-").document()["modes"]
    assert len(modes) == 3
    for mode, reference in zip(modes, whole, strict=True):
        assert mode["natural_frequency"] == pytest.approx(
            reference["natural_frequency"], abs=3 * reference["natural_frequency_std"]
        )


def test_names_are_no_markup_and_no_control_sequences(sprung, tmp_path):
    t = np.arange(20_000) / 100
    generator = np.random.default_rng(1)
    names = ("[bold red]a[/bold red]", "b :smile: [/]", "=cmd|c", "d,e")
    common = np.convolve(generator.standard_normal(t.size), np.exp(-0.3 * t[:3000]) * np.sin(18 * t[:3000]))[: t.size]
    samples = common + 0.1 * generator.standard_normal((4, t.size))
    channels = tuple(Channel(name, "acceleration") for name in names)
    path = tmp_path / "[red]run[bold].csv"
    write(Recording(samples, 100.0, channels), path)
    shown = sprung("info", path).out
    assert path.name in shown
    assert all(name in shown for name in names)
    outcome = sprung("identify", path, "--channels", '[bold red]a[/bold red],b :smile: [/],"d,e"')
    assert outcome.err == ""
    assert "[bold red]a[/bold red]+" in outcome.out
    assert math.isclose(
        float(next(line for line in outcome.out.splitlines() if "±" in line).split()[0]), 18 / 2 / np.pi, rel_tol=0.01
    )
    assert "\x1b" not in sprung("info", tmp_path / "no\n\x1b[31mfile.csv").err


@pytest.fixture
def roving(chain, tmp_path):
    """Two halves of the run of the chain: first mass with the second, first with the third, under equal names."""
    run = read(chain)
    paths = []
    for number, (name, names) in enumerate(
        (("acc_2", ("base", "rov")), ("acc_3", ("base", "rov")), ("acc_3", ("base", "third")))
    ):
        first = run.n_samples // 2 * min(number, 1)
        part = run.part(first, first + run.n_samples // 2).select(["acc_1", name])
        channels = tuple(Channel(new, "acceleration") for new in names)
        paths.append(tmp_path / f"{number}.parquet")
        write(Recording(part.samples, part.sampling_rate, channels), paths[-1])
    return paths


@pytest.mark.slow
def test_files_of_other_channels_are_set_ups_without_being_told(sprung, roving, tmp_path):
    outcome = sprung("identify", roving[0], roving[2], "--figures", tmp_path / "figures")
    assert outcome.code == 0
    assert "2 set-ups over references base" in outcome.out
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert {"stabilisation_set-up_1.png", "stabilisation_set-up_2.png", "mode_shapes.png", "mac.png"} <= names


@pytest.mark.parametrize(
    ("files", "words", "sentence"),
    [
        (slice(0, 1), ["--setups"], "--setups needs at least two files, one for each set-up"),
        (slice(0, 2), ["--setups"], "the 2 set-ups have the same channels base, rov: name those that stayed in place"),
        (slice(0, 2), ["--setups", "--references", "rob"], "reference 'rob' is not a channel of set-up 1"),
    ],
)
def test_set_ups_that_cannot_be_merged(sprung, roving, files, words, sentence):
    outcome = sprung("identify", *roving[files], *words)
    assert outcome.code != 0
    assert sentence in outcome.err


def test_shapes_are_written_by_the_ending_of_the_file(sprung, chain, tmp_path):
    page = sprung("identify", chain, "--shapes", tmp_path / "shapes.html")
    assert page.code == 0
    assert "wrote" in page.out
    assert "shapes.html" in "".join(page.out.split())
    assert "Mode shapes: run.csv" in (tmp_path / "shapes.html").read_text(encoding="utf-8")
    outcome = sprung("identify", chain, "--shapes", tmp_path / "shapes.txt")
    assert outcome.code != 0
    assert "ending of --shapes '.txt' is not one of .gif, .html, .uff, .unv" in outcome.err


def test_shapes_as_a_universal_file(sprung, chain, tmp_path):
    package = pytest.importorskip("pyuff")
    assert sprung("identify", chain, "--shapes", tmp_path / "shapes.unv").code == 0
    sets = package.UFF(str(tmp_path / "shapes.unv")).read_sets()
    assert [each["type"] for each in sets] == [164, 15, 82, 55, 55, 55]


def test_another_format_of_figures_is_refused(sprung, chain, tmp_path):
    outcome = sprung("identify", chain, "--figures", tmp_path / "new", "--format", "gif")
    assert outcome.code == 2
    assert "'gif' is not one of 'png', 'svg', 'pdf'" in outcome.err
    assert not (tmp_path / "new").exists()
