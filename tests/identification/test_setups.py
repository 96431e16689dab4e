"""Set-ups of roving sensors: recognised, identified one by one, matched and glued.

The structure is a frame of four rigid floors measured in fifteen set-ups, simulated by modes.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.signal import cont2discrete, lfilter, ss2tf
from tests.identification.runs import modes_of

from sprung.errors import DataError, ParameterError
from sprung.formats import read
from sprung.identification import IdentificationSettings, cov_ssi, identify_setups
from sprung.identification.roving import common_points, group_by_setup
from sprung.identification.setups import combine, correlations_of, glue, match_modes
from sprung.modal import mac
from sprung.recording import Channel, Recording
from sprung.signals.spectrum import spectral_matrix
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import read_description, structure

N_FLOORS, N_MODES, N_SETUPS, DAMPING = 4, 11, 15, 0.012


CORNERS = ((6.0, 3.5), (6.0, -3.5), (-6.0, -3.5), (-6.0, 3.5))


@dataclass(frozen=True)
class Frame:
    """Natural frequencies [Hz], mode shapes of the degrees of freedom, and of 32 sensors: x and y at all corners."""

    frequencies: np.ndarray
    shapes: np.ndarray
    sensed: np.ndarray
    places: tuple


def frame():
    """Return a building with unequal storeys whose floors move in x and y and turn: the lowest 11 of 12 modes."""
    mass, inertia = 20e3, 20e3 * (12.0**2 + 7.0**2) / 12
    size = 3 * N_FLOORS
    stiffness = np.zeros((size, size))
    for floor in range(N_FLOORS):
        storey = np.array([[22e6, 0, -13.2e6], [0, 30e6, 27e6], [-13.2e6, 27e6, 950e6]]) * (1 - 0.04 * floor)
        above = slice(3 * floor, 3 * floor + 3)
        stiffness[above, above] += storey
        if floor:
            below = slice(3 * floor - 3, 3 * floor)
            stiffness[below, below] += storey
            stiffness[above, below] -= storey
            stiffness[below, above] -= storey
    squares, shapes = eigh(stiffness, np.diag([mass, mass, inertia] * N_FLOORS))
    shapes = shapes[:, :N_MODES]
    places, sensed = [], []
    for floor in range(N_FLOORS):
        for x, y in CORNERS:
            u, v, turn = shapes[3 * floor : 3 * floor + 3]
            places += [((x, y, 3.0 * (floor + 1)), (1.0, 0.0, 0.0)), ((x, y, 3.0 * (floor + 1)), (0.0, 1.0, 0.0))]
            sensed += [u - y * turn, v + x * turn]
    return Frame(np.sqrt(squares[:N_MODES]) / (2 * np.pi), shapes, np.array(sensed), tuple(places))


def sensors_of_setups(n_setups=N_SETUPS):
    """Return for each set-up the numbers of its sensors: two references on the roof, and two that rove."""
    references = [8 * (N_FLOORS - 1), 8 * (N_FLOORS - 1) + 5]
    rest = [k for k in range(8 * N_FLOORS) if k not in references]
    return [references + rest[2 * k : 2 * k + 2] for k in range(n_setups)]


def accelerations(building, sensors, *, duration, rate, generator, noise):
    """Return accelerations under white forces on all floors: modes by recursion at four times the rate."""
    n_samples, fine = int(duration * rate), 4
    forces = generator.standard_normal((len(building.shapes), (n_samples + int(20 * rate)) * fine))
    modal = np.empty((N_MODES, n_samples))
    for k, frequency in enumerate(building.frequencies):
        omega = 2 * np.pi * frequency
        row = [-(omega**2), -2 * DAMPING * omega]
        state, force, output = (np.array(rows, dtype=float) for rows in ([[0, 1], row], [[0], [1]], [row]))
        system = cont2discrete((state, force, output, np.ones((1, 1))), 1 / (fine * rate), "zoh")
        numerator, denominator = ss2tf(*system[:4])
        motion = lfilter(numerator[0], denominator, building.shapes[:, k] @ forces)[-n_samples * fine :]
        modal[k] = np.fft.irfft(np.fft.rfft(motion)[: n_samples // 2 + 1], n_samples)
    samples = building.sensed[sensors] @ modal
    return samples + noise * samples.std(axis=1, keepdims=True) * generator.standard_normal(samples.shape)


def setup_records(*, names, duration=120.0, seed=1, noise=0.05, n_setups=N_SETUPS):
    """Return the building, the sensors of each set-up and a record of each, at levels that differ up to 25 times.

    `names`: "distinct" for each point its own; "same" in all set-ups; "places" the same, with positions.
    """
    building, generator = frame(), np.random.default_rng(seed)
    plan = sensors_of_setups(n_setups)
    records = []
    for sensors in plan:
        samples = accelerations(building, sensors, duration=duration, rate=100.0, generator=generator, noise=noise)
        channels = []
        for column, sensor in enumerate(sensors):
            name = f"p{sensor}" if names == "distinct" else ("ref_1", "ref_2", "rov_1", "rov_2")[column]
            place = building.places[sensor] if names == "places" else (None, None)
            channels.append(Channel(name, "acceleration", *place))
        records.append(Recording(10 ** generator.uniform(-0.7, 0.7) * samples, 100.0, tuple(channels)))
    return building, plan, records


def setups_of(identification):
    """Return the set-ups behind an identification."""
    assert identification.setups is not None
    return identification.setups


def check_modes(identification, building, plan, *, likeness=0.95):
    """Assert that all modes of the frame come out on all points, and nothing else."""
    modes, points = identification.modes, list(dict.fromkeys(sensor for sensors in plan for sensor in sensors))
    assert modes.natural_frequency == pytest.approx(building.frequencies, rel=0.01)
    allowed = np.maximum(0.3 * DAMPING, 3.5 * modes.damping_ratio_std)  # few set-ups scatter by chance
    assert np.all(np.abs(modes.damping_ratio - DAMPING) < allowed)
    true = building.sensed[points].T.astype(complex)
    assert modes.mode_shapes.shape == true.shape
    assert np.diag(mac(modes.mode_shapes, true)).min() > likeness


@pytest.mark.slow
def test_eleven_of_eleven_modes_of_a_frame_in_fifteen_set_ups() -> None:
    """Points have names of their own; deviations of the glued shapes are their scatter."""
    building, plan, records = setup_records(names="distinct")
    identification = cov_ssi(records)
    check_modes(identification, building, plan)
    setups = setups_of(identification)
    assert setups.references == ("p24", "p29")
    assert [part.channels for part in setups.parts] == [tuple(f"p{k}" for k in sensors) for sensors in plan]
    assert identification.subsets == ()
    assert identification.notes[0].startswith("15 set-ups over references p24, p29")
    shapes, std = identification.modes.mode_shapes, identification.modes.mode_shape_std
    points = list(dict.fromkeys(sensor for sensors in plan for sensor in sensors))
    true = building.sensed[points].T
    largest = np.argmax(np.abs(shapes), axis=1)
    errors = shapes.real - true / true[np.arange(N_MODES), largest][:, None]
    relative = (errors / np.where(std.real > 0, std.real, np.inf))[std.real > 0]
    assert 0.7 < np.sqrt(np.mean(relative**2)) < 1.4


@pytest.mark.slow
def test_names_that_repeat_need_references() -> None:
    building, plan, records = setup_records(names="same", n_setups=3)
    with pytest.raises(ParameterError, match="the 3 set-ups have the same channels"):
        identify_setups(cov_ssi, records)
    check_modes(identify_setups(cov_ssi, records, references=("ref_1", "ref_2")), building, plan)


@pytest.mark.slow
def test_moved_sensors_under_equal_names_give_a_note() -> None:
    _, _, records = setup_records(names="same")
    identification = cov_ssi(records)
    assert len(identification.modes) < N_MODES
    (note,) = [note for note in identification.notes if "move differently from record to record" in note]
    assert "such as ref_1, ref_2, as references (--references)" in note


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.05, 1.0])
def test_parts_of_one_record_give_no_note(noise) -> None:
    _, _, (record,) = setup_records(names="same", n_setups=1, duration=600.0, noise=noise)
    parts = [record.part(first, first + 6000) for first in range(0, record.n_samples, 6000)]
    levels = np.random.default_rng(1).uniform(0.1, 10.0, len(parts))
    parts = [Recording(level * part.samples, 100.0, part.channels) for level, part in zip(levels, parts, strict=True)]
    assert not any("differently" in note for note in cov_ssi(parts).notes)


@pytest.mark.slow
def test_positions_tell_set_ups_apart() -> None:
    building, plan, records = setup_records(names="places", n_setups=3)
    identification = cov_ssi(records)
    points = list(dict.fromkeys(sensor for sensors in plan for sensor in sensors))
    assert [channel.position for channel in identification.channels] == [building.places[k][0] for k in points]
    assert setups_of(identification).references == ("ref_1", "ref_2")
    check_modes(identification, building, plan)


@pytest.mark.slow
def test_a_mode_that_one_set_up_lacks_is_fitted_there(fits_once) -> None:
    building, plan, records = setup_records(names="distinct", n_setups=4, duration=240.0)
    whole = identify_setups(fits_once["cov"], records)
    narrow = IdentificationSettings(band=(4.0, 14.0))

    def identify(record, *, settings=None, vehicle=None, on_progress=None):
        is_second = record.names == records[1].names
        return fits_once["cov"](record, settings=narrow if is_second else settings, vehicle=vehicle)

    identification = identify_setups(identify, records)
    members = setups_of(identification).parts[1].members
    assert np.array_equal(members < 0, building.frequencies < 4.0)
    assert np.isnan(setups_of(identification).parts[1].mac[members < 0]).all()
    assert np.diag(mac(identification.modes.mode_shapes, whole.modes.mode_shapes)).min() > 0.98
    assert any("3 of 11 modes were not found in every set-up" in note for note in identification.notes)
    check_modes(identification, building, plan, likeness=0.9)


def test_correlations_of_spectra_are_those_of_the_samples() -> None:
    generator = np.random.default_rng(5)
    samples = lfilter([1.0], [1.0, -1.2, 0.8], generator.standard_normal((2, 200_000)))
    samples[1] += 0.5 * np.roll(samples[0], 3)
    recording = Recording(samples, 100.0, (Channel("a"), Channel("b")))
    correlations = correlations_of(spectral_matrix(recording, segment_length=5.0))
    n = samples.shape[1]
    for lag in (0, 3, 20):
        expected = samples[:, lag:] @ samples[:, : n - lag].T / (n - lag)
        assert correlations.values[..., lag] == pytest.approx(expected, abs=0.02 * np.abs(samples).var())


@pytest.mark.slow
def test_a_bad_set_up_is_left_out_with_a_note() -> None:
    _, _, records = setup_records(names="distinct", n_setups=3)
    dead = np.array(records[1].samples)
    dead[2] = 0.0
    identification = cov_ssi([records[0], Recording(dead, 100.0, records[1].channels), records[2]])
    assert [part.number for part in setups_of(identification).parts] == [1, 3]
    assert identification.notes[0].startswith("set-up 2 left out: channel 'p2' is constant at 0")
    with pytest.raises(ParameterError, match=r"need at least two usable set-ups, got 1: set-up 1 channel 'p2'"):
        identify_setups(cov_ssi, [Recording(dead, 100.0, records[1].channels), records[2]])
    with pytest.raises(DataError, match="there is no set-up"):
        identify_setups(cov_ssi, [])


@pytest.mark.slow
def test_three_storey_building_of_three_set_ups(real_file) -> None:
    # Exact natural frequencies of the finite-element model behind the samples. As one condition: twins, and four lost.
    exact = [2.63186, 2.69173, 3.43042, 8.29742, 8.42882, 10.6272, 14.0053, 14.093, 17.5741]
    records = [read(real_file(f"three_storey_L_fe/set{k}_100Hz.npy"), sampling_rate=100.0) for k in (1, 2, 3)]
    identification = identify_setups(cov_ssi, records, references=records[0].names[:3])
    assert identification.modes.natural_frequency == pytest.approx(exact, rel=0.01)
    assert len(identification.channels) == 3 + 3 * 7
    assert min(part.mac.min() for part in setups_of(identification).parts) > 0.99


@pytest.mark.slow
def test_a_sensor_that_no_setup_has_is_missing() -> None:
    """Each set-up lacks sensors of the vehicle file: that is roving, unless all lack the same one."""
    chain = read_description("chain3")
    excitation = usual_excitation(structure(chain))
    run = simulate(structure(chain), excitation, duration=120.0, sampling_rate=200.0, seed=1)
    setups = [run.select(["acc_1", "acc_2"]), run.select(["acc_1", "acc_3"])]
    assert {channel.name for channel in cov_ssi(setups, vehicle=chain).channels} == {"acc_1", "acc_2", "acc_3"}
    named = chain.model_copy(
        update={"sensor": tuple(s.model_copy(update={"channel": s.channel.replace("_3", "C")}) for s in chain.sensor)}
    )
    lazily = ([record] for record in [run.select(["acc_1", "acc_2"]), run.select(["acc_1"])])
    with pytest.raises(ParameterError, match="lacks 1 of the vehicle file's 3 sensors: accC: make"):
        identify_setups(cov_ssi, lazily, references=["acc_1"], vehicle=named)


modes = partial(modes_of, damping=0.01, std=0.001, damping_std=0.001)


def random_setups(generator, n_setups=4, n_references=2, n_roving=3, noise=0.0):
    """Return a complex shape on all points, and its noisy part in each set-up at a random complex scale."""
    n_points = n_references + n_setups * n_roving
    shape = generator.standard_normal(n_points) + 0.3j * generator.standard_normal(n_points)
    shape /= shape[np.argmax(np.abs(shape))]
    rows = [
        [*range(n_references), *range(n_references + n_roving * k, n_references + n_roving * (k + 1))]
        for k in range(n_setups)
    ]
    parts = []
    for own in rows:
        error = generator.standard_normal((2, len(own))) * noise / np.sqrt(2)
        scale = 10 ** generator.uniform(-1, 1) * np.exp(2j * np.pi * generator.uniform())
        parts.append(scale * (shape[own] + error[0] + 1j * error[1]))
    return shape, rows, parts


def test_shapes_without_noise_come_out_exactly() -> None:
    shape, rows, parts = random_setups(np.random.default_rng(1))
    glued = glue(parts, rows, n_points=len(shape))
    assert glued.shape == pytest.approx(shape, abs=1e-9)
    for scale, own, part in zip(glued.scales, rows, parts, strict=True):
        assert scale * shape[own] == pytest.approx(part, abs=1e-9)
    assert glued.variance == pytest.approx(np.zeros(len(shape)), abs=1e-12)


def test_a_chain_of_set_ups_is_glued_link_by_link() -> None:
    shape = np.array([0.2, 0.5, -0.7, 1.0, 0.4j])
    rows = [[0, 1], [1, 2], [2, 3], [3, 4]]
    glued = glue([shape[own] * (k + 1j) for k, own in enumerate(rows, start=1)], rows, n_points=5)
    assert glued.shape == pytest.approx(shape, abs=1e-9)
    assert np.isnan(glued.variance[[0, 1, 2, 4]]).all()


def test_the_variance_is_the_scatter_over_simulated_set_ups() -> None:
    # Parts are scaled to 1 at their largest channel, so that equal variances need parts that are nearly equal there:
    # all set-ups share the largest point.
    shape, rows, _ = random_setups(np.random.default_rng(3), n_references=3)
    shape[0], noise = 1.5, 0.02
    shape /= shape[0]
    errors, expected = [], []
    generator = np.random.default_rng(4)
    for _ in range(200):
        parts = [
            shape[own] + noise * (generator.standard_normal(len(own)) + 1j * generator.standard_normal(len(own)))
            for own in rows
        ]
        glued = glue(parts, rows, n_points=len(shape))
        errors.append(np.abs(glued.shape - shape) ** 2)
        expected.append(glued.variance)
    ratio = np.mean(errors, axis=0)[1:] / np.mean(expected, axis=0)[1:]
    assert ratio.mean() == pytest.approx(1.0, abs=0.15)
    assert np.all((ratio > 0.6) & (ratio < 1.5))


def test_modes_are_matched_by_frequency_and_shape() -> None:
    one, two = [1.0, 0.5, 0.2], [0.5, -1.0, 0.3]
    parts = [
        modes([2.000, 2.020, 5.0], shapes=[one, two, one]),
        modes([2.006, 2.028], shapes=[one, two]),
        modes([2.015, 4.99], shapes=[two, one]),
    ]
    members = match_modes(parts, [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    assert sorted(map(tuple, members.tolist())) == [(0, 0, -1), (1, 1, 0), (2, -1, 1)]


def test_two_modes_of_one_set_up_are_never_the_same() -> None:
    parts = [modes([2.000, 2.001], shapes=[[1.0], [1.0]]), modes([2.0005], shapes=[[1.0]])]
    members = match_modes(parts, [[0], [0]])
    assert all(np.count_nonzero(row >= 0) <= 2 for row in members)
    assert sorted(members[:, 0].tolist()) == [0, 1]


def test_a_mode_of_fewer_than_half_of_the_set_ups_is_left_out() -> None:
    shape = [[1.0, 0.5]]
    parts = [modes([2.0], shapes=shape), modes([2.0], shapes=shape), modes([2.001, 7.0], shapes=[*shape, *shape])]
    assert match_modes(parts, [[0, 1]] * 3).tolist() == [[0, 0, 0]]


def test_estimates_without_excess_scatter_are_weighted_by_variance() -> None:
    mean, std = combine(np.array([1.0, 1.3]), np.array([1.0, 2.0]))
    assert mean == pytest.approx((1.0 + 1.3 / 4) / 1.25)
    assert std == pytest.approx(1.25**-0.5)


def test_scatter_between_estimates_is_in_the_deviation() -> None:
    values = np.array([0.0, 1.0, 2.0, 3.0])
    mean, std = combine(values, np.full(4, 1e-3))
    assert mean == pytest.approx(1.5)
    assert std == pytest.approx(values.std(ddof=1) / 2, rel=1e-3)
    assert combine(values, np.full(4, np.nan)) == pytest.approx((mean, values.std(ddof=1) / 2))


def channels(*names, positions=None):
    """Return channels of known names, and positions if given."""
    places = positions or [None] * len(names)
    return tuple(Channel(name, "acceleration", place) for name, place in zip(names, places, strict=True))


def record(*names, positions=None):
    """Return a record of a few samples."""
    return Recording(np.zeros((len(names), 4)), 100.0, channels(*names, positions=positions))


def test_records_of_the_same_channels_are_one_set_up() -> None:
    here = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]
    assert len(group_by_setup([record("a", "b"), record("b", "a")])) == 1
    assert len(group_by_setup([record("a", "b", positions=here), record("a", "b", positions=here)])) == 1
    assert len(group_by_setup([record("a", "b", positions=here), record("a", "b")])) == 1


def test_records_of_other_names_or_positions_are_set_ups() -> None:
    here, there = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    first, second = record("a", "b"), record("a", "c")
    groups = group_by_setup([first, second, first])
    assert [len(group) for group in groups] == [2, 1]
    assert len(group_by_setup([record("a", "b", positions=here), record("a", "b", positions=there)])) == 2


def test_the_speed_and_the_temperature_make_no_set_up() -> None:
    first = Recording(np.zeros((2, 4)), 100.0, (Channel("a", "acceleration"), Channel("speed", "speed")))
    assert len(group_by_setup([first, record("a")])) == 1


def test_channels_of_one_name_are_one_point() -> None:
    points = common_points([channels("a", "b"), channels("a", "c")])
    assert [channel.name for channel in points.channels] == ["a", "b", "c"]
    assert points.rows == ((0, 1), (0, 2))
    assert points.references == ("a",)


def test_moved_channels_carry_the_number_of_their_set_up() -> None:
    here, there = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    points = common_points([channels("a", "b", positions=here), channels("a", "b", positions=there)])
    assert [channel.name for channel in points.channels] == ["a", "b (1)", "b (2)"]
    assert [channel.position for channel in points.channels] == [here[0], here[1], there[1]]
    named = common_points([channels("a", "b"), channels("a", "b")], references=["a"])
    assert [channel.name for channel in named.channels] == ["a", "b (1)", "b (2)"]


def test_a_chain_of_set_ups_has_no_point_in_common() -> None:
    points = common_points([channels("a", "b"), channels("b", "c"), channels("c", "d")])
    assert points.references == ("b", "c")


@pytest.mark.parametrize(
    ("layouts", "references", "sentence"),
    [
        (["ab", "ac"], ["b"], "reference 'b' is not a channel of set-up 2, which has a, c: name channels that all"),
        (
            ["ab", "ab"],
            None,
            "the 2 set-ups have the same channels a, b: name those that stayed in place as references",
        ),
        (["ab", "cd"], None, "set-up 2 .c, d. shares no channel with the others, .* keep at least one sensor in place"),
    ],
)
def test_set_ups_that_cannot_be_merged(layouts, references, sentence) -> None:
    with pytest.raises(ParameterError, match=f"^{sentence}"):
        common_points([channels(*names) for names in layouts], references=references)
