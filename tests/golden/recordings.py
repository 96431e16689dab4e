"""Recordings, simulated or drawn by seed, and the commands that are run on them."""

import io
import json
import struct
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from tests.golden.freezing import DIGITS, NOISE

import sprung
from sprung import Channel, Gap, Recording

#: A command, or what is done to the files in between.
Step = str | Callable[[Path], None]


@dataclass(frozen=True)
class Case:
    """Steps in an empty folder; `digits` that are the same on every machine; a package that a step `needs`."""

    steps: Sequence[Step]
    digits: int = DIGITS
    needs: str = ""


def disturbed(recording: Recording, seed: int = 0) -> Recording:
    """Return a recording with the noise that is asked for."""
    noise = np.random.default_rng(seed).standard_normal(recording.samples.shape)
    return replace(recording, samples=recording.samples * (1 + NOISE * noise))


def _chain(duration: float = 40.0, seed: int = 1, start: int | None = None) -> Recording:
    """Return accelerations of a chain of three masses."""
    chain = sprung.structure(sprung.read_description("chain3"))
    run = sprung.simulate(
        chain, sprung.usual_excitation(chain), duration=duration, sampling_rate=100.0, snr=20.0, seed=seed
    )
    return disturbed(replace(run, start=start))


def _stated(name: str, text: str) -> Callable[[Path], None]:
    """Return a step that writes a file of conditions."""

    def step(folder: Path) -> None:
        (folder / name).write_text(text, encoding="utf-8")

    return step


def _changed(source: str, target: str, change: Callable[[Recording], Recording]) -> Callable[[Path], None]:
    """Return a step that writes a changed recording."""

    def step(folder: Path) -> None:
        sprung.write(change(sprung.read(folder / source)), folder / target)

    return step


def _drawn(target: str, draw: Callable[[], Recording]) -> Callable[[Path], None]:
    """Return a step that writes a recording."""
    return lambda folder: sprung.write(draw(), folder / target)


def _text(name: str, write: Callable[[Recording], str | bytes]) -> Callable[[Path], None]:
    """Return a step that writes the chain in a format of its own."""

    def step(folder: Path) -> None:
        content = write(_chain())
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())

    return step


def _row_change(channel: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Recording], Recording]:
    """Return a change of one channel."""

    def changed(recording: Recording) -> Recording:
        samples = recording.samples.copy()
        row = recording.names.index(channel)
        samples[row] = change(samples[row])
        return replace(recording, samples=samples)

    return changed


def _dead_from_half(values: np.ndarray) -> np.ndarray:
    return np.where(np.arange(values.size) < values.size // 2, values, 0.0)


def _clipped(values: np.ndarray) -> np.ndarray:
    return np.clip(values, -1.2 * values.std(), 1.2 * values.std())


def _with_tone(recording: Recording) -> Recording:
    """Add a harmonic of 12.5 Hz to all channels."""
    times = np.arange(recording.samples.shape[1]) / recording.sampling_rate
    tone = np.sin(2 * np.pi * 12.5 * times) + 0.4 * np.sin(2 * np.pi * 25.0 * times)
    return replace(recording, samples=recording.samples + 1.5 * recording.samples.std() * tone)


def _with_gaps(recording: Recording) -> Recording:
    return replace(recording, gaps=(Gap(1500, 2.0), Gap(2600, 0.03)))


def _german(run: Recording) -> str:
    rows = (f"{k / 100:.2f};{';'.join(f'{v / 9.80665:.9f}' for v in run.samples[:, k])}" for k in range(4000))
    return "Zeit [s];acc_1 [g];acc_2 [g];acc_3 [g]\n" + "\n".join(rows).replace(".", ",") + "\n"


def _dated(run: Recording) -> str:
    rows = (
        f"2026-03-04T05:{6 + k // 6000:02d}:{k // 100 % 60:02d}.{k % 100:02d}Z," + ",".join(f"{v:.9e}" for v in values)
        for k, values in enumerate(run.samples.T)
    )
    return "timestamp,acc_1 [m/s^2],acc_2 [m/s^2],speed [km/h]\n" + "\n".join(rows) + "\n"


def _without_times(run: Recording) -> str:
    rows = ("\t".join(f"{v:.9e}" for v in values) for values in run.samples.T)
    return "# a ride\nacc_1\tacc_2\tacc_3\nm/s^2\tm/s^2\tm/s^2\n" + "\n".join(rows) + "\n"


def _lvm(run: Recording) -> str:
    end = "***End_of_Header***"
    head = [
        *("LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab", "Decimal_Separator\t."),
        *("Multi_Headings\tYes", "X_Columns\tNo", "Time_Pref\tAbsolute", "Operator\tJo", end, "\t"),
        *("Channels\t3", "Samples\t4000\t4000\t4000", "Date\t2024/05/31\t2024/05/31\t2024/05/31"),
        *("Time\t10:00:00\t10:00:00\t10:00:00", "Y_Unit_Label\tm/s^2\tm/s^2\tm/s^2", "X0\t0\t0\t0"),
        *("Delta_X\t0.01\t0.01\t0.01", end, "X_Value\tacc_1\tacc_2\tacc_3\tComment"),
    ]
    return "\n".join([*head, *("\t" + "\t".join(f"{v:.9e}" for v in values) for values in run.samples.T)]) + "\n"


def _wav(run: Recording) -> bytes:
    scaled = np.round(run.samples.T / np.abs(run.samples).max() * 32000).astype("<i2").tobytes()
    layout = struct.pack("<HHIIHH", 1, 3, 100, 600, 6, 16)
    content = b"WAVEfmt " + struct.pack("<I", len(layout)) + layout + b"data" + struct.pack("<I", len(scaled)) + scaled
    return b"RIFF" + struct.pack("<I", len(content)) + content


def _phone_rows(run: Recording) -> list[tuple[str, ...]]:
    begun = 1_698_501_144_401_000_000
    return [
        (str(begun + 10_000_000 * k), f"{k / 100:.2f}", *(f"{v:.9f}" for v in values))
        for k, values in enumerate(run.samples.T)
    ]


def _phone_archive(run: Recording) -> bytes:
    rows = [",".join(row) for row in _phone_rows(run)]
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("Accelerometer.csv", "time,seconds_elapsed,z,y,x\n" + "\n".join(rows) + "\n")
        file.writestr("Metadata.csv", "version,device name,platform\n3,SM-G970F,android\n")
    return content.getvalue()


def _phone_records(run: Recording) -> str:
    names = ("time", "seconds_elapsed", "z", "y", "x")
    records = [{"sensor": "Accelerometer", **dict(zip(names, row, strict=True))} for row in _phone_rows(run)]
    return json.dumps([{"sensor": "Metadata", "version": "3", "platform": "android"}, *records])


def _mdf(folder: Path) -> None:
    from asammdf import MDF, Signal

    run, file = _chain(), MDF(version="4.10")
    stamps = np.arange(4000) / 100
    names = ("acc_1", "acc_2", "acc_3")
    signals = [Signal(run.samples[k], stamps, name=name, unit="m/s^2", comment="x") for k, name in enumerate(names)]
    file.append(signals, comment="body", common_timebase=True)
    slow = stamps[::20]
    file.append([Signal(36 + slow / 10, slow, name="speed", unit="km/h")], comment="bus", common_timebase=True)
    file.start_time = datetime(2026, 3, 4, 5, 6, 7, 891011, tzinfo=UTC)
    file.save(folder / "run.mf4", overwrite=True)
    file.close()


def _tdms(folder: Path) -> None:
    nptdms: Any = import_module("nptdms")
    run = _chain()
    start = np.datetime64("2026-03-04T05:06:07.891011", "us")
    clock = {"wf_increment": 0.01, "wf_start_time": start, "wf_start_offset": 0.0, "unit_string": "g"}
    channels = [nptdms.ChannelObject("body", f"acc_{k + 1}", run.samples[k] / 9.80665, clock) for k in range(3)]
    with nptdms.TdmsWriter(folder / "run.tdms") as writer:
        writer.write_segment([nptdms.RootObject({"title": "ride", "author": "M. Ring"}), *channels])


def _setups(folder: Path) -> None:
    """Two set-ups of roving sensors with one reference."""
    run = _chain(80.0)
    for number, rows in enumerate(([0, 1], [0, 2]), start=1):
        channels = tuple(run.channels[row] for row in rows)
        part = slice(0, 4000) if number == 1 else slice(4000, 8000)
        sprung.write(replace(run, samples=run.samples[rows, part], channels=channels), folder / f"setup-{number}.npz")


def _noise() -> Recording:
    samples = np.random.default_rng(1).standard_normal((2, 20_000))
    return disturbed(Recording(samples, 100.0, (Channel("a"), Channel("b"))))


#: Files that hold no usable recording.
_BAD = {
    "empty.csv": "",
    "heading.csv": "time,a,b\n",
    "one.csv": "time,a,b\n0,1,2\n",
    "words.csv": "time,a,b\n0,1,2\n0.01,x,3\n0.02,1,3\n",
    "constant.csv": "time,a,b\n" + "".join(f"{0.01 * k:.2f},5,{(k * 7919) % 101}\n" for k in range(2000)),
    "unit.csv": "time,a [furlong],b [g]\n" + "".join(f"{0.01 * k:.2f},{(k * 7919) % 101},1\n" for k in range(200)),
    "double.csv": "time,a,a\n0,1,2\n0.01,2,3\n",
    "backwards.csv": "time,a\n0,1\n0.01,2\n0.005,3\n0.02,1\n",
    "good.csv": "time,a,b\n" + "".join(f"{0.01 * k:.2f},{(k * 7919) % 101},{(k * 104729) % 97}\n" for k in range(2000)),
    "notes.doc": "\0\1 notes",
    "cut.npz": "PK\3\4 cut",
    "vehicle.toml": 'schema = "sprung.vehicle/1"\nkind = "road"\n',
    "bad.json": "{",
}


def _bad_files(folder: Path) -> None:
    for name, text in _BAD.items():
        (folder / name).write_text(text)


_SOFT = "simulate road --minutes {minutes} --sampling-rate 100 --snr 50 --seed {seed} {words} --out {name}"


def _road(name: str, words: str = "", *, minutes: float = 10, seed: int = 1) -> str:
    return " ".join(_SOFT.format(name=name, words=words, minutes=minutes, seed=seed).split())


_DEVIATIONS = """
[deviations]
individual = 3
values = { mass = 0.07 }
scatter = { spring = 0.04, damper = 0.05, tyre = 0.03 }
"""
_TOWN = """
n_stops = 1
[[payload]]
mass = 80.0
x = -0.9
y = -0.4
[suspension]
temperature = 5.0
nonlinear = true
[road]
potholes = { per_kilometre = 3.0 }
[driving]
braking = 2.0
cornering = 2.0
[deviations.sensors]
gain = 0.02
tilt = 0.03490658503988659
[accelerometers]
noise_density = 980.665e-6
bits = 14
"""
_CHAIN = "simulate chain --minutes 1 --sampling-rate 100 --snr 10"
_LEARN = "baseline healthy.npz --vehicle zafira --window 5 --windows 4 --no-calibrate --out b.json"
_SHEET = "--mass 1350 --wheelbase 2.65 --track 1.5 --tyre 205/55R16"
_READ = ("info {0}", "info {0} --json -", "identify {0} --json -")


def _reading(name: str, words: str = "") -> tuple[str, ...]:
    return tuple(f"{line.format(name)} {words}".strip() for line in _READ)


#: Digits of what a search over many parameters finds.
_FITTED = 4

RECORDINGS = {
    "chain-csv": Case(
        (
            f"{_CHAIN} --seed 1 --out run.csv --json -",
            "info run.csv",
            "info run.csv --json -",
            "identify run.csv",
            "identify run.csv --json - --report run.html",
            "convert run.csv run.parquet",
            "convert run.csv part.csv --from 10 --to 20 --channels acc_3,acc_1",
            "info run.parquet part.csv --json -",
            "convert run.parquet run.mat",
            "convert run.mat run.uff",
            "convert run.uff run.h5",
            "info run.uff run.h5",
        )
    ),
    "chain-acs": Case(
        (
            f"{_CHAIN} --seed 2 --out run.npz",
            "identify run.npz --method acs",
            "identify run.npz --method acs --band 2 40 --no-refine --json -",
        )
    ),
    "chain-coss": Case(
        (
            f"{_CHAIN} --seed 3 --out run.parquet",
            "identify run.parquet --method coss",
            "identify run.parquet --method coss --subsets 2 --json -",
        )
    ),
    "chain-plscf": Case(
        (
            f"{_CHAIN} --seed 4 --out run.mat",
            "identify run.mat --method plscf",
            "identify run.mat --method plscf --json -",
        )
    ),
    "chain-fdd": Case(
        (
            f"{_CHAIN} --seed 5 --out run.npz",
            "identify run.npz --method fdd",
            "identify run.npz --method fdd --pick 7,19.6 --json -",
        )
    ),
    "chain-settings": Case(
        (
            f"{_CHAIN} --seed 6 --noise-band 1 30 --out run.npz",
            "identify run.npz --block-rows 20 --max-order 16 --stable-rate 0.4 --json -",
            "identify run.npz --thesis --block-rows 20",
            "identify run.npz --references disjoint",
            "identify run.npz --vehicle chain3 --channels acc_1,acc_3 --allow-missing",
        )
    ),
    "chain-fault": Case(
        (
            "simulate chain --minutes 1 --sampling-rate 100 --snr 10 --records 3 --seed 7 --out a.npz",
            f"{_CHAIN} --seed 8 --start 2025-01-08T08:03 --fault mass_1.spring=-0.2 --out b.npz --json -",
            "identify a-01.npz a-02.npz a-03.npz --json a.json",
            "identify b.npz --json b.json",
            "track a.json b.json",
            "track a-01.npz a-02.npz a-03.npz b.npz --json -",
            "track b.npz --window 20 --report t.html",
        )
    ),
    "quarter-random": Case(
        (
            "simulate quarter --minutes 1 --sampling-rate 250 --seed 1 --snr 30 --out run.npz --json -",
            "identify run.npz --vehicle quarter",
            "identify run.npz --json -",
        )
    ),
    "quarter-pulses": Case(
        (
            "simulate quarter --minutes 1 --sampling-rate 250 --case 2 --seed 2 --fault corner.spring=0.3 "
            "--out run.npz",
            "info run.npz",
            "identify run.npz --json -",
        )
    ),
    "quarter-harmonics": Case(
        (
            "simulate quarter --minutes 1 --sampling-rate 250 --seed 3 --case 3 --out run.npz",
            "identify run.npz",
            "identify run.npz --cepstrum 1 --json -",
        )
    ),
    "rig": Case(
        (
            "simulate rig --minutes 2 --sampling-rate 200 --snr 20 --seed 1 --out run.npz --json -",
            "info run.npz",
            "identify run.npz --vehicle scale-bogie --band 5 60 --json -",
        ),
        digits=_FITTED,
    ),
    "rig-front": Case(
        (
            _stated("front.toml", 'driven = "front"'),
            "simulate rig --minutes 2 --sampling-rate 200 --snr 20 --seed 2 --conditions front.toml "
            "--fault front_left.spring=-0.3 --out run.npz",
            "identify run.npz --vehicle scale-bogie --band 5 60",
            "identify run.npz --method coss --band 5 60 --json -",
        )
    ),
    "rail": Case(
        (
            "simulate rail --minutes 2 --sampling-rate 100 --snr 20 --seed 1 --out run.npz --json -",
            "info run.npz",
            "identify run.npz --vehicle y25",
            "corners run.npz --vehicle y25 --kind rail --json -",
        ),
        digits=_FITTED,
    ),
    "road": Case(
        (
            _road("run.npz", "--json -", minutes=3),
            "info run.npz --json -",
            "identify run.npz --vehicle zafira",
            "identify run.npz --vehicle zafira --json -",
            "corners run.npz --vehicle zafira --report c.html",
            "corners run.npz --vehicle zafira --json -",
        ),
        digits=_FITTED,
    ),
    "road-alone": Case(
        (
            _road("all.npz", minutes=3, seed=4),
            "convert all.npz run.npz --channels acc_fl,acc_fr,acc_rl,acc_rr",
            "identify run.npz",
            "identify run.npz --json -",
            "corners run.npz --vehicle zafira",
        ),
        digits=_FITTED,
    ),
    "road-orders": Case(
        (
            _stated("orders.toml", "[wheel_orders]\nunbalance = 15e-3\nrun_out = [1e-3]"),
            _road("run.npz", "--conditions orders.toml --speed 12 12.5", minutes=3, seed=5),
            "identify run.npz",
            "identify run.npz --vehicle zafira --json -",
        ),
        digits=_FITTED,
    ),
    "road-conditions": Case(
        (
            _stated("town.toml", _TOWN),
            _road(
                "run.npz",
                "--conditions town.toml --json -",
                minutes=4,
                seed=6,
            ),
            "info run.npz",
            "corners run.npz --vehicle run.npz.vehicle.toml --sensors",
            "corners run.npz --vehicle run.npz.vehicle.toml --no-payload --free spring,damper --json -",
        ),
        digits=_FITTED,
    ),
    "road-calibrate": Case(
        (
            _stated("deviations.toml", _DEVIATIONS),
            _road("run.npz", "--conditions deviations.toml", minutes=5, seed=7),
            "calibrate run.npz --vehicle zafira --window 5 --mounts 0 --no-modes --out k.toml --json k.json",
            "corners run.npz --vehicle k.toml",
        ),
        digits=_FITTED,
    ),
    "road-diagnose": Case(
        (
            _road("healthy.npz", minutes=20),
            _LEARN,
            _road("soft.npz", "--fault front_left.spring=-0.3", minutes=10, seed=2),
            "diagnose soft.npz --vehicle zafira --window 5 --baseline b.json --report d.html",
            "diagnose soft.npz --vehicle zafira --window 5 --baseline b.json --json -",
            "diagnose healthy.npz --vehicle zafira --window 5 --baseline b.json",
            "diagnose soft.npz --vehicle zafira --window 5 --json -",
            _changed("soft.npz", "dead.npz", _row_change("acc_fl", _dead_from_half)),
            "diagnose dead.npz --vehicle zafira --window 5 --baseline b.json",
            _changed("healthy.npz", "clipped.npz", _row_change("acc_rr", _clipped)),
            "info clipped.npz",
            "diagnose clipped.npz --vehicle zafira --window 5 --baseline b.json --json -",
            "baseline soft.npz --vehicle zafira --window 5 --windows 2 --no-calibrate --previous b.json "
            "--reason 'new springs' --out b2.json",
        ),
        digits=_FITTED,
    ),
    "describe": Case(
        (
            f"describe {_SHEET} --name golf --out golf.toml",
            f"describe {_SHEET} --front-share 0.6 --ride-frequency 1.1 1.3 --pressure 2.5 --sensors imu --out imu.toml",
            f"describe {_SHEET} --unsprung 40 35 --sensors travel --out travel.toml",
            "simulate road --vehicle imu.toml --minutes 3 --sampling-rate 100 --snr 50 --seed 8 --out run.npz --json -",
            "corners run.npz --vehicle imu.toml",
        ),
        digits=_FITTED,
    ),
    "faulty-channels": Case(
        (
            _drawn("all.npz", _chain),
            _changed("all.npz", "dead.npz", _row_change("acc_2", _dead_from_half)),
            _changed("all.npz", "clipped.npz", _row_change("acc_3", _clipped)),
            _changed("all.npz", "zero.npz", _row_change("acc_1", np.zeros_like)),
            "info dead.npz clipped.npz zero.npz",
            "info dead.npz clipped.npz zero.npz --json -",
            "identify clipped.npz --json -",
            "identify dead.npz",
            "identify zero.npz",
        )
    ),
    "harmonics": Case(
        (
            _drawn("run.npz", lambda: _with_tone(_chain(60.0))),
            "info run.npz",
            "identify run.npz --json -",
            "identify run.npz --method fdd",
        )
    ),
    "gaps": Case(
        (
            _drawn("run.csv", lambda: _with_gaps(_chain(60.0, start=1_772_600_767_000_000_000))),
            *_reading("run.csv"),
            "info run.csv --bridge 0.1",
            "track run.csv --window 20",
        )
    ),
    "setups": Case((_setups, "identify setup-1.npz setup-2.npz", "identify setup-1.npz setup-2.npz --setups --json -")),
    "noise": Case(
        (
            _drawn("run.npz", _noise),
            "identify run.npz --report r.html",
            "identify run.npz --method fdd --json -",
        )
    ),
    "csv-german": Case((_text("run.csv", _german), *_reading("run.csv"))),
    "csv-dated": Case((_text("run.csv", _dated), *_reading("run.csv", "--channels acc_1,acc_2"))),
    "csv-without-times": Case(
        (_text("run.tsv", _without_times), "info run.tsv", *_reading("run.tsv", "--sampling-rate 100"))
    ),
    "lvm": Case((_text("run.lvm", _lvm), *_reading("run.lvm"))),
    "wav": Case((_text("run.wav", _wav), *_reading("run.wav"))),
    "phone-zip": Case((_text("ride.zip", _phone_archive), *_reading("ride.zip"))),
    "phone-json": Case((_text("ride.json", _phone_records), *_reading("ride.json"))),
    "uff": Case((_drawn("run.uff", _chain), *_reading("run.uff")), needs="pyuff"),
    "mdf": Case((_mdf, *_reading("run.mf4", "--group body")), needs="asammdf"),
    "tdms": Case((_tdms, *_reading("run.tdms")), needs="nptdms"),
    "mistakes": Case(
        (
            _bad_files,
            "info missing.csv",
            *(f"info {name}" for name in _BAD if name.endswith((".csv", ".doc", ".npz"))),
            "identify constant.csv",
            "identify good.csv --frobnicate",
            "identify good.csv --band 5 2",
            "identify good.csv --method magic",
            "identify good.csv --block-rows 100000",
            "identify good.csv --channels a,z",
            "identify good.csv --vehicle nothing",
            "identify good.csv --vehicle vehicle.toml",
            "identify good.csv --vehicle zafira",
            "identify good.csv --json nowhere/modes.json",
            "track good.csv --window 0",
            "track bad.json",
            "corners good.csv --vehicle chain3",
            "corners good.csv",
            "diagnose good.csv --vehicle zafira --baseline bad.json",
            "baseline good.csv --vehicle zafira --out b.json --previous bad.json",
            "calibrate good.csv --vehicle zafira --out good.toml --window 0",
            "describe --mass 1350 --wheelbase 2.65 --track 1.5 --tyre wide --out car.toml",
            "convert good.csv good.xyz",
            "simulate chain --out a.xyz --minutes 0.1",
            "simulate road --fault front_left.wing=-0.2 --out a.npz",
            "simulate boat --out a.csv",
            "vehicles --store sqlite:///none.sqlite",
            "report bus-1 --store sqlite:///none.sqlite --json -",
            "sail",
        )
    ),
}
