"""The challenge: scores are proper, entries are checked in one sentence, sets are sealed, and strangers can enter."""

import json
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

ROOT = Path(__file__).parents[2]
HERE = ROOT / "benchmarks" / "challenge"
PARTS = ["front_left.spring", "front_left.damper", "front_right.spring"]
CHANGED = {"kind": "road", "parts": PARTS, "onsets": [10, 14], "part": PARTS[0], "since": 11, "change": -0.2}


@pytest.fixture(scope="module")
def challenge() -> Any:
    sys.path.insert(0, str(ROOT))
    try:
        names = ("__main__", "entrants", "entry", "make", "score", "tables")
        modules = {name.strip("_"): import_module(f"benchmarks.challenge.{name}") for name in names}
    finally:
        sys.path.remove(str(ROOT))
    return SimpleNamespace(**modules)


@pytest.mark.parametrize("rule", ["brier", "log_score"])
def test_true_probabilities_have_the_best_expected_score(challenge: Any, rule: str) -> None:
    """For any true distribution p and any other q, the mean of the loss over p is least where q = p."""
    score, generator = getattr(challenge.score, rule), np.random.default_rng(1)
    for _ in range(200):
        p, q = (dict(zip("abcd", row, strict=True)) for row in generator.dirichlet(np.ones(4), 2))
        honest, other = (sum(p[x] * score(said, x) for x in p) for said in (p, q))
        assert honest < other


def test_true_quantiles_have_the_best_expected_interval_score(challenge: Any) -> None:
    """Of a normal variable, by quadrature; the least mean is 4 pdf(1.96) / 0.05 = 4.676 standard deviations."""

    def expected(low: float, high: float) -> float:
        return sum(
            quad(lambda x: challenge.score.interval_score((low, high), x) * norm.pdf(x), a, b)[0]
            for a, b in ((-12, low), (low, high), (high, 12))
        )

    z = norm.ppf(0.975)
    best = expected(-z, z)
    assert best == pytest.approx(4 * norm.pdf(z) / 0.05, rel=1e-6)
    for low, high in ((-1.5, 1.5), (-2.6, 2.6), (-1.5, 2.5), (0.0, 0.0), (-z, z + 0.2)):
        assert expected(low, high) > best + 0.005


def test_a_wrong_part_with_confidence_costs_more_than_silence(challenge: Any) -> None:
    def scored(**said: Any) -> dict[str, Any]:
        return challenge.score.score_life(challenge.entry.Life(**said), CHANGED)

    silent = scored()
    right, wrong = (scored(parts={part: 0.95}) for part in PARTS[:2])
    false = scored(healthy=0.95)
    for rule in ("brier", "log"):
        assert right[rule] < silent[rule] < min(wrong[rule], false[rule])
    narrow, usual = scored(change=[-0.5, -0.45], since=[13, 14]), scored()
    for name in ("change", "since"):
        assert scored(change=[-0.22, -0.18], since=[11, 11])[name] < usual[name] < narrow[name]


def test_silence_is_the_base_rates(challenge: Any) -> None:
    """A third of all lives are healthy; losses are log-uniform from 5 to 50 %, so that 2.5 % are below 5 % 10^0.025."""
    said = challenge.score.probabilities(challenge.entry.Life(), PARTS)
    assert said == pytest.approx({"healthy": 1 / 3} | dict.fromkeys(PARTS, 2 / 9))
    stated = challenge.score.probabilities(challenge.entry.Life(healthy=0.4, parts={PARTS[0]: 0.3}), PARTS)
    assert sum(stated.values()) == pytest.approx(1.0)
    assert stated["healthy"] == pytest.approx(0.4 + 0.3 / 3)
    assert challenge.score.usual_change() == pytest.approx((-0.05 * 10**0.975, -0.05 * 10**0.025))
    lives = list(
        challenge.make.lives(challenge.make.Source("", 3), challenge.make.Sizes(road=3000, rail=0, multibody=0))
    )
    losses = -np.array([life.change for life in lives if life.part])
    assert abs(len(losses) / 3000 - 2 / 3) < 0.03
    assert np.mean((losses > 0.05 * 10**0.025) & (losses < 0.05 * 10**0.975)) == pytest.approx(0.95, abs=0.015)


def test_modes_are_scored_once_each(challenge: Any) -> None:
    """Two certified modes: one with an interval of 0.1 Hz and 2 points, one missing, and one that is none."""
    known = [{"natural_frequency": f, "damping_ratio": 0.1} for f in (2.0, 4.0)]
    truth = {"modes": known, "optional_modes": [{"natural_frequency": 12.0, "damping_ratio": 0.1}]}
    modes = [
        challenge.entry.Mode(natural_frequency=[f - 0.05, f + 0.05], damping_ratio=[0.09, 0.11])
        for f in (2.02, 7.0, 12.1)
    ]
    scored = challenge.score.score_modes(modes, truth)
    assert (scored["found"], scored["spurious"], scored["frequency_held"]) == (1, 1, 1)
    assert scored["frequency"] == pytest.approx(5.0 + 2 * 10.0)
    assert scored["damping"] == pytest.approx(2.0 + 2 * 30.0)
    outside = [challenge.entry.Mode(natural_frequency=[2.02, 2.04], damping_ratio=[0.1, 0.1])]
    alone = {"modes": known[:1], "optional_modes": []}
    assert challenge.score.score_modes(outside, alone)["frequency"] == pytest.approx(1.0 + 40 * 1.0)


def test_pairs_are_scored_by_their_order(challenge: Any) -> None:
    order = challenge.score.score_order
    assert order({}, "abc") == pytest.approx(0.5)
    assert order({("a", "b"): 0.9, ("c", "a"): 0.1, ("b", "c"): 0.9}, "abc") == pytest.approx(2 * 0.1**2)
    assert order({("b", "a"): 0.9}, "ab") == pytest.approx(2 * 0.9**2)


CASES = {
    "modes": {"bogie": {}},
    "corners": {"corners-01": {"parts": PARTS}},
    "lives": {"road-01": {"parts": PARTS}},
    "order": {"clicks": {"parts": ["a", "b"]}},
}


@pytest.mark.parametrize(
    ("task", "said", "sentence"),
    [
        ("lives", {"road-99": {}}, "lives: 'road-99' is none of road-01."),
        ("lives", {"road-01": {"parts": {"wing": 0.5}}}, f"lives.road-01.parts: 'wing' is none of {', '.join(PARTS)}."),
        (
            "lives",
            {"road-01": {"healthy": 0.6, "parts": {PARTS[0]: 0.5}}},
            "lives.road-01: the probabilities add up to 1.1, but at most 0.999 is allowed.",
        ),
        ("lives", {"road-01": {"healthy": 1}}, "lives.road-01.healthy: Input should be less than or equal to 0.999."),
        (
            "lives",
            {"road-01": {"change": [-0.1, -0.2]}},
            "lives.road-01.change: [-0.1, -0.2] is no interval: give its lower and then its upper end.",
        ),
        ("corners", {"corners-01": {PARTS[0]: [1.0]}}, f"corners.corners-01.{PARTS[0]}.1: Field required."),
        (
            "order",
            {"clicks": [{"first": "a", "second": "c", "probability": 0.5}]},
            "order.clicks.0: 'c' is none of a, b.",
        ),
        ("lifes", {}, "lifes: Extra inputs are not permitted."),
    ],
)
def test_an_entry_is_refused_in_one_sentence(challenge: Any, task: str, said: Any, sentence: str) -> None:
    document = {"schema": "sprung.challenge-entry/1", "entrant": "any", task: said}
    with pytest.raises(challenge.entry.EntryError) as refused:
        challenge.entry.parse_entry(document, CASES)
    assert str(refused.value) == sentence


def test_the_schema_is_that_of_the_check(challenge: Any) -> None:
    assert json.loads((HERE / "entry.schema.json").read_text(encoding="utf-8")) == challenge.entry.schema()


def test_the_truth_is_sealed(challenge: Any, tmp_path: Path) -> None:
    """The open set has the published hash; another salt or seed has another one, and hides the truth as well."""
    make, published = challenge.make, json.loads((HERE / "hashes.json").read_text(encoding="utf-8"))
    sources = [make.Source("", 1), make.Source("pepper", 1), make.Source("", 2)]
    digests = [make.truth_archive(tmp_path / f"{k}.zip", source) for k, source in enumerate(sources)]
    assert digests[0] == published["practice"]
    assert len(set(digests)) == 3
    known = [make.read_truth(tmp_path / f"{k}.zip") for k in range(3)]
    assert known[0]["lives"] != known[1]["lives"]
    assert [life["kind"] for life in known[0]["lives"].values()].count("rail") == 10
    assert len(known[0]["lives"]) == 40
    assert len(known[0]["modes"]) == 13, "certified records added after the sets were sealed are not in them"


@pytest.mark.slow
def test_a_part_changes_from_its_first_recording_on(challenge: Any) -> None:
    """The same seeds with and without a change: recordings before it are equal, those from it on are not."""
    make = challenge.make
    source, sizes = make.Source("", 1), make.Sizes(learning=2, watched=2, life_duration=10.0)
    for kind, simulated in (("road", make.road_life), ("rail", make.rail_life)):
        file, healthy = simulated(source, make.Life(f"{kind}-01", kind), sizes)
        _, changed = simulated(source, make.Life(f"{kind}-01", kind, "rear_left.spring", 4, -0.3), sizes)
        assert len(healthy) == 4
        assert {sensor.channel for sensor in file.sensor} <= set(healthy[0].names)
        equal = [np.array_equal(a.samples, b.samples) for a, b in zip(healthy, changed, strict=True)]
        assert equal == [True, True, True, False]
    growing = make.Life("road-01", "road", PARTS[0], 3, -0.3, is_growing=True)
    assert [growing.change_at(k, 5) for k in range(1, 6)] == pytest.approx([0, 0, -0.1, -0.2, -0.3])


@pytest.fixture(scope="module")
def small(challenge: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a set of one record, one drive and one life with a lost damper, beside its truth."""
    make, folder = challenge.make, tmp_path_factory.mktemp("challenge") / "small"
    sizes = make.Sizes(
        road=1, multibody=0, rail=0, corners=1, learning=7, watched=6, life_duration=130.0, corner_duration=150.0
    )
    source = make.Source("", 12)
    assert [(life.part, life.since) for life in make.lives(source, sizes)] == [("rear_left.damper", 11)]
    for name in ("short", "corners-01", "road-01"):
        make.make_set(folder, source, sizes=sizes, only=name, report=lambda _: None)
    make.truth_archive(folder.with_name("truth.zip"), source, sizes)
    return folder


@pytest.mark.slow
def test_the_example_of_the_readme_enters(challenge: Any, small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its code runs by itself, in a process without this package, on NumPy alone."""
    (code,) = re.findall(r"```python\n(.*?)```", (HERE / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    script, entry = small.with_name("my_entry.py"), small.with_name("mine.json")
    script.write_text(code, encoding="utf-8")
    subprocess.run([sys.executable, "-I", str(script), str(small), str(entry)], check=True)
    assert challenge.main.main(["check", str(entry), "--data", str(small)]) == 0
    assert "1 of lives" in capsys.readouterr().out
    assert challenge.main.main(["score", str(entry), "--truth", str(small.with_name("truth.zip"))]) == 0
    assert "| road, nonlinear | my RMS |" in capsys.readouterr().out
    entry.write_text(entry.read_text(encoding="utf-8").replace("road-01", "road-1"), encoding="utf-8")
    assert challenge.main.main(["check", str(entry), "--data", str(small)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        ("make --out {folder}/x --only raod-*", "raod-* is the name of no case, such as "),
        ("check {folder}/entry.json --data {folder}/x", "x has no manifest.json"),
        ("enter rms --data {folder}/x --out {folder}/y.json", "x has no manifest.json"),
        ("enter rms --data {folder} --out {folder}/y.json --tasks lives,mode", "'mode' is none of modes, corners"),
        ("score {folder}/entry.json --truth {folder}/no.zip", "no.zip is no archive of a truth"),
        ("score {folder}/entry.json --truth {folder}/entry.json", "entry.json is no archive of a truth"),
        ("table {folder}/entry.json", "entry.json is no file that `score --json` wrote"),
        ("table {folder}/no.json", "no.json is no file that `score --json` wrote"),
    ],
)
def test_a_wrong_path_or_name_is_said_in_one_sentence(
    challenge: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, sentence: str
) -> None:
    document = {"schema": "sprung.challenge-entry/1", "entrant": "somebody"}
    (tmp_path / "entry.json").write_text(json.dumps(document))
    (tmp_path / "manifest.json").write_text(json.dumps({task: {} for task in ("modes", "corners", "lives", "order")}))
    assert challenge.main.main(command.format(folder=tmp_path).split()) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1


def test_a_package_that_an_entrant_needs_is_named(
    challenge: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def absent(folder: Path, asked: Any) -> None:
        raise ModuleNotFoundError("No module named 'koma'", name="koma")

    (tmp_path / "manifest.json").write_text(json.dumps({task: {} for task in ("modes", "corners", "lives", "order")}))
    monkeypatch.setitem(challenge.main.ENTRANTS, "koma", absent)
    assert challenge.main.main(["enter", "koma", "--data", str(tmp_path), "--out", str(tmp_path / "e.json")]) == 2
    assert capsys.readouterr().err == "koma needs the package koma: install benchmarks/requirements.lock.\n"


def test_the_score_of_a_part_of_a_set_says_so(
    challenge: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = {"schema": "sprung.challenge-entry/1", "entrant": "mine", "lives": {"road-01": {"healthy": 0.6}}}
    (tmp_path / "entry.json").write_text(json.dumps(document))
    truth = tmp_path / "truth.zip"
    challenge.make.truth_archive(truth, challenge.make.Source("", 1))
    assert challenge.main.main(["score", str(tmp_path / "entry.json"), "--truth", str(truth)]) == 0
    said = capsys.readouterr().err
    assert said == "mine: 1 of 40 lives; what is left out is scored as silence (--data FOLDER: only its cases).\n"


@pytest.mark.slow
def test_sprung_names_a_weak_damper(challenge: Any, small: Path) -> None:
    truth, scores = small.with_name("truth.zip"), small.with_name("scores.json")
    for entrant in ("sprung", "rms"):
        entry = small.with_name(f"{entrant}.json")
        assert challenge.main.main(["enter", entrant, "--data", str(small), "--out", str(entry)]) == 0
        assert challenge.main.main(["score", str(entry), "--truth", str(truth), "--json", str(scores)]) == 0
        scored = json.loads(scores.read_text(encoding="utf-8"))
        life = scored["lives"]["road-01"]
        assert (life["first"] == life["truth"]) == (entrant == "sprung")
        if entrant == "sprung":
            assert life["brier"] < 0.1
            assert scored["modes"]["short"]["found"] >= 2
            costs = [cost for kind in scored["corners"]["corners-01"].values() for cost, _, _ in kind]
            assert np.median(costs) < 20.0  # silence: 59 to 65 on average


def test_the_tables_of_the_readme_are_those_of_the_results(challenge: Any) -> None:
    results = [json.loads(path.read_text(encoding="utf-8")) for path in sorted((HERE / "results").glob("*.json"))]
    assert challenge.tables.tables(results) in (HERE / "README.md").read_text(encoding="utf-8")
