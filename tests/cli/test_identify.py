import json
import math
from pathlib import Path

import numpy as np
import pytest

from sprung.formats import read, write
from sprung.identification import coss_ssi, cov_ssi
from sprung.modal import mac
from sprung.recording import Channel, Recording

MODE_KEYS = {
    "natural_frequency": float,
    "natural_frequency_std": float,
    "damping_ratio": float,
    "damping_ratio_std": float,
    "mode_shape": dict,
    "mode_shape_std": dict,
    "label": type(None),
    "stable_rate": float,
    "source": str,
    "subsets": list,
    "mpc": float,
    "participation": type(None),
    "level_trend": type(None),
}


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


def test_document_has_the_keys_and_types_of_the_contract(sprung, chain):
    result = sprung("identify", chain, "--json", "-").document()
    assert result["schema"] == "sprung.identification/1"
    assert result["method"] == "cov"
    assert result["channels"] == ["acc_1", "acc_2", "acc_3"]
    assert isinstance(result["sampling_rate"], float)
    assert {"modes", "subsets", "notes", "harmonics", "band", "settings"} <= set(result)
    assert all(isinstance(note, str) for note in result["notes"])
    for mode in result["modes"]:
        assert {key: type(mode[key]) for key in mode} == MODE_KEYS
        assert mode["mode_shape"].keys() == {"real", "imag"}
        assert len(mode["mode_shape"]["real"]) == len(mode["mode_shape"]["imag"]) == 3
        assert 0 <= mode["stable_rate"] <= 1
    frequencies = [mode["natural_frequency"] for mode in result["modes"]]
    assert frequencies == sorted(frequencies)
    (subset,) = result["subsets"]
    assert set(subset) == {"n_segments", "level", "modes"}
    assert subset["level"] is None


def test_command_line_gives_what_the_library_gives(sprung, chain):
    ours = cov_ssi(read(chain)).modes
    modes = sprung("identify", chain, "--json", "-").document()["modes"]
    np.testing.assert_array_equal([mode["natural_frequency"] for mode in modes], ours.natural_frequency)
    np.testing.assert_array_equal([mode["damping_ratio_std"] for mode in modes], ours.damping_ratio_std)
    np.testing.assert_array_equal([shape_of(mode) for mode in modes], ours.mode_shapes)


def test_subsets_of_coss_keep_their_own_values(sprung, chain):
    ours = coss_ssi(read(chain))
    result = sprung("identify", chain, "--method", "coss", "--json", "-").document()
    assert len(result["subsets"]) == len(ours.subsets) > 1
    for subset, expected in zip(result["subsets"], ours.subsets, strict=True):
        assert subset["n_segments"] == expected.n_segments
        assert expected.level is not None
        assert subset["level"] == list(expected.level)
        assert subset["level"][0] < subset["level"][1]
    for mode, members in zip(result["modes"], ours.members, strict=True):
        for value, subset, member in zip(mode["subsets"], result["subsets"], members, strict=True):
            if member < 0:
                assert value is None
            else:
                assert value["natural_frequency"] == subset["modes"][member]["natural_frequency"]
                assert value["damping_ratio"] == subset["modes"][member]["damping_ratio"]


def test_several_files_are_records_of_one_condition(sprung, tmp_path):
    words = ("simulate", "chain", "--minutes", "1", "--sampling-rate", "200", "--records", "3")
    assert sprung(*words, "--out", tmp_path / "run.npz").code == 0
    files = sorted(tmp_path.glob("run-*.npz"))
    assert [path.name for path in files] == ["run-01.npz", "run-02.npz", "run-03.npz"]
    ours = cov_ssi([read(path) for path in files]).modes
    modes = sprung("identify", *files, "--json", "-").document()["modes"]
    np.testing.assert_array_equal([mode["natural_frequency"] for mode in modes], ours.natural_frequency)
    assert "3 files" in sprung("identify", *files).out


def test_vehicle_file_gives_labels_and_participation(sprung, bogie):
    outcome = sprung("identify", bogie, "--vehicle", "scale-bogie", "--band", "5", "60", "--json", "-")
    modes = outcome.document()["modes"]
    assert [mode["label"] for mode in modes] == ["bounce", "pitch", "roll"]
    for mode in modes:
        share = mode["participation"]
        assert share["bounce"] + share["pitch"] + share["roll"] == pytest.approx(1)
        assert share[mode["label"]] > 0.5
        assert 0.7 < share["explained"] <= 1
    table = sprung("identify", bogie, "--vehicle", "scale-bogie", "--band", "5", "60").out
    assert "pitch  fl+ fr+ rl- rr-" in table or "pitch  fl- fr- rl+ rr+" in table


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


def test_stable_rate_reaches_the_criteria_and_selects(sprung, chain):
    result = sprung("identify", chain, "--stable-rate", "0.9", "--json", "-").document()
    assert result["settings"]["criteria"]["stable_rate"] == 0.9
    assert all(mode["stable_rate"] >= 0.9 for mode in result["modes"])


def test_thesis_criteria_are_those_of_the_thesis(sprung, chain):
    criteria = sprung("identify", chain, "--thesis", "--json", "-").document()["settings"]["criteria"]
    assert (criteria["frequency"], criteria["damping"], criteria["shape"]) == (0.1, 0.2, 0.5)
    assert criteria["uncertainty"] is None  # infinite, which JSON does not have


def test_method_and_channels_are_as_asked(sprung, chain):
    result = sprung("identify", chain, "--method", "acs", "--channels", "acc_3, acc_1", "--json", "-").document()
    assert (result["method"], result["channels"]) == ("acs", ["acc_3", "acc_1"])


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


@pytest.mark.slow
def test_harmonics_are_reported_and_not_called_modes(sprung, tmp_path):
    path = tmp_path / "quarter.parquet"
    assert sprung("simulate", "quarter", "--case", "4", "--minutes", "2", "--seed", "3", "--out", path).code == 0
    result = sprung("identify", path, "--band", "5", "100", "--json", "-").document()
    lines = [line["frequency"] for line in result["harmonics"]]
    assert min(abs(line - 17.0) for line in lines) < 0.1
    assert all(line["unit"] == "Hz" and line["kind"] == "constant" for line in result["harmonics"])
    assert not any(abs(mode["natural_frequency"] - 17.0) < 0.2 for mode in result["modes"])
    table = sprung("identify", path, "--band", "5", "100").out
    assert "Harmonics of the excitation, not modes" in table


def test_no_mode_is_no_answer_but_the_document_is_written(sprung, chain, tmp_path):
    path = tmp_path / "none.json"
    outcome = sprung("identify", chain, "--band", "80", "95", "--json", path)
    assert outcome.code == 3
    assert "no mode found" in outcome.err
    assert "frequency outside the band" in outcome.err
    assert outcome.err.count("\n") == 1
    document = json.loads(path.read_text())
    assert document["modes"] == []
    assert sprung("identify", chain, "--band", "80", "95", "--json", "-").document() == document


def test_no_pole_at_all_is_named(sprung, chain):
    outcome = sprung("identify", chain, "--max-order", "2")
    assert outcome.code == 3
    assert "--max-order" in outcome.err or "poles" in outcome.err


def test_unknown_uncertainty_is_null(sprung, chain):
    modes = sprung("identify", chain, "--segment", "1e6", "--no-refine", "--json", "-").document()["modes"]
    assert modes
    assert all(mode["natural_frequency_std"] is None for mode in modes)
    assert "nan" not in sprung("identify", chain, "--segment", "1e6", "--no-refine").out


def test_table_names_modes_notes_and_shapes(sprung, chain):
    outcome = sprung("identify", chain)
    assert outcome.err == ""
    assert f"{chain}: 3 modes by Cov-SSI from 3 channels" in outcome.out.replace("\n", "")
    shapes = [line.rsplit("  ", 1)[1].strip() for line in outcome.out.splitlines() if " ± " in line]
    assert shapes == ["1+ 2+ 3+", "1+ 2+ 3-", "1- 2+ 3-"]
    assert "- band " in outcome.out


def test_json_file_and_table_go_together(sprung, chain, tmp_path):
    outcome = sprung("identify", chain, "--json", tmp_path / "modes.json")
    assert "3 modes" in outcome.out
    assert len(json.loads((tmp_path / "modes.json").read_text())["modes"]) == 3


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


@pytest.mark.slow
def test_figures_are_written_and_named(sprung, chain, tmp_path):
    outcome = sprung("identify", chain, "--figures", tmp_path / "figures")
    assert outcome.code == 0
    written = sorted((tmp_path / "figures").iterdir())
    assert written
    assert all(path.name in outcome.out.replace("\n", "") for path in written)


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


@pytest.mark.parametrize("method", ["cov", "coss", "plscf", "fdd"])
def test_second_opinions_agree_and_modes_are_picked(sprung, chain, method):
    found = sprung("identify", chain, "--method", method, "--json", "-").document()
    assert found["method"] == method
    assert [mode["natural_frequency"] for mode in found["modes"]] == pytest.approx([7.01, 19.65, 28.39], rel=0.02)
    picked = sprung("identify", chain, "--method", method, "--pick", "19.5,7", "--json", "-").document()
    assert [mode["natural_frequency"] for mode in picked["modes"]] == pytest.approx([7.01, 19.65], rel=0.02)
    assert sum("picked by hand" in note for note in picked["notes"]) == 2


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


def test_files_as_set_ups_of_roving_sensors(sprung, chain, roving):
    true = json.loads(Path(f"{chain}.truth.json").read_text(encoding="utf-8"))["modes"]
    words = ("identify", *roving[:2], "--setups", "--references", "base")
    result = sprung(*words, "--json", "-").document()
    assert result["channels"] == ["base", "rov (1)", "rov (2)"]
    assert result["setups"]["references"] == ["base"]
    assert [part["channels"] for part in result["setups"]["parts"]] == [["base", "rov (1)"], ["base", "rov (2)"]]
    assert [part["members"] for part in result["setups"]["parts"]] == [[0, 1, 2], [0, 1, 2]]
    assert result["subsets"] == []
    assert len(result["modes"]) == 3
    for mode, truth in zip(result["modes"], true, strict=True):
        assert mode["natural_frequency"] == pytest.approx(truth["natural_frequency"], rel=0.01)
        assert mac(shape_of(mode)[None], shape_of(truth)[None])[0, 0] > 0.98
    shown = sprung(*words)
    assert shown.code == 0
    heading = shown.out.splitlines()[0]
    assert heading == "2 files: 3 modes by Cov-SSI from 3 channels at 200 Hz, 2 set-ups over references base"
    assert "2 of 2" in shown.out


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


@pytest.mark.slow
@pytest.mark.parametrize(("ending", "head"), [("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_figures_have_the_format_that_is_asked_for(sprung, chain, tmp_path, ending, head):
    outcome = sprung("identify", chain, "--figures", tmp_path, "--format", ending)
    assert outcome.code == 0, outcome.err
    names = {"stabilisation", "spectra", "mode_shapes", "complexity", "mac"}
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.{ending}" for name in names}
    assert all(path.read_bytes().startswith(head) for path in tmp_path.iterdir())


def test_another_format_of_figures_is_refused(sprung, chain, tmp_path):
    outcome = sprung("identify", chain, "--figures", tmp_path / "new", "--format", "gif")
    assert outcome.code == 2
    assert "'gif' is not one of 'png', 'svg', 'pdf'" in outcome.err
    assert not (tmp_path / "new").exists()
