"""Real recordings: one measurement in ten files of seven formats, and the clocks of real loggers."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.formats import ReadSettings, read, read_blocks, write
from sprung.signals.inspection import inspect

CAR = "formats/converted/car_imu_30s"


@pytest.mark.parametrize(
    ("ending", "rate"),
    [
        ("_semicolon_decimalcomma.csv", 1e-6),
        (".parquet", 1e-6),
        ("_v5.mat", 1e-6),
        ("_v73.mat", 1e-6),
        (".mf4", 1e-6),
        (".h5", 1e-5),  # the rate as stated in the file, not that of the time stamps
        (".tdms", 1e-5),
        ("_ascii.uff", 1e-3),
        ("_bin.uff", 1e-3),
    ],
)
def test_one_measurement_in_every_format(real_file, ending, rate) -> None:
    reference = read(real_file(f"{CAR}.csv"))
    recording = read(real_file(f"{CAR}{ending}"))
    assert reference.samples.shape == (6, 3130)
    np.testing.assert_allclose(recording.samples, reference.samples, rtol=0, atol=6e-7, equal_nan=False)
    assert recording.sampling_rate == pytest.approx(reference.sampling_rate, rel=rate)
    assert recording.gaps == ()
    if ending != "_v73.mat":  # that file holds no names
        assert recording.names == reference.names


def test_jittering_logger_is_resampled(real_file) -> None:
    """The stamps of this car's logger lie up to 22 ms apart at a mean rate of 101.3 Hz; no sample is lost."""
    recording = read(real_file("canedge_car_body_imu/00000165_00000002-60FEB8E3_decoded.parquet"))
    assert recording.sampling_rate == pytest.approx(101.3, abs=0.05)
    assert recording.duration == pytest.approx(600, abs=0.1)
    assert recording.gaps == ()
    assert "resampled" in recording.history[1]
    assert recording.samples[0].mean() == pytest.approx(9.65, abs=0.2)


def test_jittering_logger_in_blocks(real_file) -> None:
    path = real_file("canedge_car_body_imu/00000165_00000002-60FEB8E3_decoded.parquet")
    parts = [block.samples for block in read_blocks(path, block_samples=5000)]
    assert len(parts) > 10
    np.testing.assert_allclose(np.concatenate(parts, axis=1), read(path).samples, rtol=0, atol=1e-7)


def test_bursts_of_a_bus_logger(real_file) -> None:
    """No names; up to 8 rows share a stamp, and once the logger stalled for 4.7 s without losing a sample."""
    path = real_file("landcruiser_axle_4acc/20211027T145815_sensors.csv")
    recording = read(path)
    assert recording.sampling_rate == pytest.approx(117, abs=0.3)
    assert recording.samples.shape == (24, path.read_text().count("\n"))
    assert recording.names[0] == "column_2"
    assert recording.gaps == ()
    assert "bursts" in recording.history[1]


def test_positions_of_a_satellite_receiver(real_file) -> None:
    recording = read(real_file("landcruiser_axle_4acc/20211027T145614_gps.csv"))
    assert recording.names == ("column_2", "column_3", "column_4")
    assert recording.sampling_rate == pytest.approx(1, abs=1e-3)


def test_whole_seconds_without_a_name_may_be_a_counter(real_file) -> None:
    path = real_file("landcruiser_axle_4acc/20211027T145815_gps.csv")
    with pytest.raises(
        ParameterError, match="'column_1' rises evenly: if it is the time, name it with --time column_1"
    ):
        read(path)
    assert read(path, settings=ReadSettings(time="column_1")).sampling_rate == pytest.approx(1)


def test_zipped_table_of_a_bridge(real_file) -> None:
    recording = read(real_file("munich_test_bridge/UniBw_2022-04-11_ref_support_load_01AllM100Hz.csv.zip"))
    assert recording.names == ("ACC01_z", "DMS_AS", "FRC-01", "INC01")
    assert [channel.quantity for channel in recording.channels] == ["acceleration", "strain", "force", "angle"]
    assert recording.samples[:, 0] == pytest.approx(
        [4.93101433676202e-05 * 9.80665, -478.429168701172e-6, 233_929.28125, np.radians(0.0080034947022795)]
    )
    assert recording.sampling_rate == 100
    assert np.datetime64(recording.start, "ns") == np.datetime64("2022-11-04T08:36:24.897")


def test_preamble_of_an_exported_table(real_file) -> None:
    """A counter of microseconds is the time, and one of packets is no channel."""
    path = real_file("mini_shake_table/original_Flexible_3rd_floor_Northridge_XsensDOT.csv")
    recording = read(path)
    assert recording.names == tuple(f"{kind}_{axis}" for kind in ("Euler", "Acc", "Gyr") for axis in "XYZ")
    assert recording.samples.shape == (9, 12117)
    assert recording.sampling_rate == pytest.approx(120, abs=0.01)
    assert any("'PacketCounter' (a counter)" in line for line in recording.history)
    assert "Xsens DOT" in recording.comment
    chosen = read(path, sampling_rate=120, channels=["Acc_X", "Acc_Z"])
    assert chosen.samples[:, 1].tolist() == [-0.10001820325851, 9.86060142517090]


@pytest.mark.parametrize(
    "name",
    [
        "landcruiser_axle_4acc/20211027T145614_sensors.csv",
        "mini_shake_table/original_Flexible_3rd_floor_Northridge_XsensDOT.csv",
        "munich_test_bridge/UniBw_2022-04-11_ref_support_load_01AllM100Hz.csv.zip",
        "munich_test_bridge/ReferenceStateINCAt100Hz.csv.zip",
        "canedge_car_body_imu/00000165_00000001-60FEB68B_decoded.parquet",
        f"{CAR}.csv",
    ],
)
def test_real_recordings_have_no_faults(real_file, name) -> None:
    assert [facts.name for facts in inspect(read(real_file(name))).channels if facts.faults] == []


def test_arrays_of_a_simulated_bridge(real_file) -> None:
    recording = read(real_file("lysefjord_bridge_sim/BridgeData.mat"))
    assert recording.names == ("rz_1", "rz_2", "rz_3", "rz_4", "rz_5")
    assert recording.n_samples == 54_000
    assert recording.sampling_rate == 15


def test_array_of_a_building(real_file) -> None:
    recording = read(real_file("palisaden_clt_building/palisaden_0_30min_100Hz.npy"), sampling_rate=100)
    assert recording.samples.shape == (6, 180_000)


@pytest.mark.parametrize(
    ("name", "groups"),
    [
        ("formats/dewesoft/Example_Drive01.d7d", ["100 Hz"]),
        ("endaq_car_ide/DAQ12006_000005.IDE", ["100g PE Acceleration"]),
        ("endaq_car_ide/GPS-Chick-Fil-A_003.IDE", ["100g PE Acceleration"]),
        ("endaq_car_ide/GPS-Chick-Fil-A_003.h5", ["ch80_40g_DC_Acceleration"]),
        ("mini_shake_table/Flexible_3_story_Northridge.npz", []),
        ("mini_shake_table/Stiff_3_story_Northridge.npz", ["Ground", "1st", "2nd", "3rd"]),
        ("formats/uff/MPSTD_Set001_2024_10_08_10_27_07.uff", []),
        ("formats/lvm/long_single_header_multi_ch.lvm", []),
        ("formats/lvm/multi_time_column.lvm", []),
        ("formats/lvm/no_decimal_separator.lvm", []),
        ("formats/lvm/short.lvm", []),
        ("formats/lvm/short_new_line_end.lvm", []),
        ("formats/lvm/with_empty_fields.lvm", []),
    ],
)
def test_originals_are_read_and_converted(real_file, tmp_path, name, groups) -> None:
    recording = read(real_file(name), settings=ReadSettings(groups=groups))
    assert np.isfinite(recording.samples).all()
    write(recording, tmp_path / "run.parquet")
    again = read(tmp_path / "run.parquet")
    assert again.names == recording.names
    np.testing.assert_allclose(again.samples, recording.samples, rtol=1e-12, equal_nan=False)
    assert again.sampling_rate == pytest.approx(recording.sampling_rate, rel=1e-6)
