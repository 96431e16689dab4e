"""Tables of identifications and tracked modes."""

import numpy as np
import pytest

from sprung.identification import cov_ssi
from sprung.identification.methods import WindowModes
from sprung.identification.tracking import track_modes
from sprung.modal import Modes
from sprung.results.tables import describe_tracks, modes_table, tracks_notes, tracks_table
from sprung.results.tables.identification import format_moment
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain


@pytest.fixture(scope="module")
def identification():
    """Return three modes by SSI."""
    masses = chain()
    return cov_ssi(simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=500.0, seed=1))


def test_the_source_is_shown_where_a_vehicle_on_its_road_gives_modes(identification) -> None:
    assert "source" not in modes_table(identification.modes, identification.sources).columns
    table = modes_table(identification.modes, ("ssi", "road_likelihood", "ssi"))
    column = table.columns.index("source")
    assert [row[column] for row in table.rows] == ["SSI", "vehicle on its road", "SSI"]
    assert {len(row) for row in table.rows} == {len(table.columns)}


START = 1_795_266_000 * 10**9


def modes(frequency):
    return Modes(
        poles=2 * np.pi * np.array([frequency]) * (1j * np.sqrt(1 - 0.02**2) - 0.02),
        mode_shapes=np.ones((1, 2), dtype=complex),
        channels=("a", "b"),
        natural_frequency_std=np.array([0.01]),
        damping_ratio_std=np.array([0.001]),
        stable_rate=np.ones(1),
        labels=("wheel_hop",),
    )


def test_table_and_notes() -> None:
    # Alternately 0.01 Hz above and below 4 Hz, then 5 % lower.
    frequencies = [4.0 + 0.01 * (-1) ** k - (0.2 if k >= 10 else 0.0) for k in range(20)]
    windows = [WindowModes(60.0 * k, "f.csv", modes(frequency)) for k, frequency in enumerate(frequencies)]
    windows[3] = WindowModes(180.0, "f.csv", None, "too short")
    tracked = track_modes([window.modes for window in windows], times=[window.time for window in windows])
    assert describe_tracks(tracked) == "1 mode followed over 19 windows with modes, of 20"
    assert tracks_notes(tracked, windows) == ["window 4 (f.csv): too short"]
    ((name, frequency, change, damping, ratio, count, span, jumps),) = tracks_table(tracked).rows
    assert name == "1 wheel hop"
    mean, deviation = map(float, frequency.split(" ± "))
    assert mean == pytest.approx((9 * 4.0 + 10 * 3.8) / 19, abs=5e-3)
    assert deviation == pytest.approx(0.02 / 0.6745 / np.sqrt(2), abs=1e-3)
    assert -8 < float(change.split(" ± ")[0]) < -5
    assert damping.startswith("2.0")
    assert float(ratio) == pytest.approx(2.1, abs=0.05)
    assert (count, span, jumps) == ("19 (100 %)", "0 s\n19 min", "-5.2 % at 10 min")
    dated = tracks_table(tracked, start=START).rows[0]
    assert dated[-2:] == ("2026-11-21 13:00\n2026-11-21 13:19", "-5.2 % at 2026-11-21 13:10")


def test_moments() -> None:
    assert format_moment(4.0, start=None, has_times=False) == "5"
    assert format_moment(90.0, start=None, has_times=True) == "90 s"
    assert format_moment(5400.0, start=None, has_times=True) == "90 min"
    assert format_moment(10800.0, start=None, has_times=True) == "3 h"
