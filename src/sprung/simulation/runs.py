"""Runs of chains and quarter vehicles, which do not drive; several records of one simulation, and their truth."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sprung.errors import ParameterError
from sprung.excitation import Excitation
from sprung.recording import Recording
from sprung.simulation.drives import DriveSettings, RailDrive, RigRun, RoadDrive
from sprung.simulation.linear import simulate, usual_excitation
from sprung.simulation.truth import truth
from sprung.vehicles import Chain, Fault, Quarter, structure, with_faults

_KINDS: dict[type[DriveSettings], str] = {RoadDrive: "road", RailDrive: "rail", RigRun: "rig"}


@dataclass(frozen=True, slots=True, kw_only=True)
class StationaryRun:
    """Settings of a run of a chain or a quarter vehicle.

    Parameters
    ----------
    duration
        Duration of the recording [s].
    sampling_rate
        Sampling rate [Hz].
    excitation
        Excitation of the inputs; None: white noise on all of them, see `usual_excitation`.
    faults
        Changes of springs and dampers, constant in time.
    snr
        RMS of the signal over that of the sensor noise, an amplitude ratio; None: no noise.
    noise_band
        Band of the sensor noise [Hz]; None: white.

    Raises
    ------
    ParameterError
        If a fault begins later or grows.
    """

    duration: float = 600.0
    sampling_rate: float
    excitation: Excitation | None = None
    faults: tuple[Fault, ...] = ()
    snr: float | None = None
    noise_band: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for fault in self.faults:
            if not fault.is_constant:
                raise ParameterError(
                    f"the fault of {fault.component} begins later or grows, as only faults of drives can: give its"
                    " change"
                )


@dataclass(frozen=True, eq=False, slots=True)
class SimulatedRun:
    """Recording of a simulated run, and the truth about it.

    Parameters
    ----------
    recording
        Signals of the sensors.
    truth
        JSON object `sprung.truth/1` with the settings of the run.
    """

    recording: Recording
    truth: dict[str, Any]


def simulate_run(vehicle: Chain | Quarter, settings: StationaryRun, *, seed: int | list[int] = 0) -> SimulatedRun:
    """Simulate a run of a chain or a quarter vehicle.

    Parameters
    ----------
    vehicle
        Chain or quarter vehicle with sensors.
    settings
        Settings of the run.
    seed
        Seed of the excitation and the noise.

    Returns
    -------
    SimulatedRun
        Recording in SI units, with its truth.

    Raises
    ------
    ParameterError
        If the vehicle lacks a component that a fault names, and as for `simulate`.
    """
    healthy = structure(vehicle)
    excitation = settings.excitation or usual_excitation(healthy)
    options: dict[str, Any] = {
        name: getattr(settings, name) for name in ("duration", "sampling_rate", "snr", "noise_band")
    }
    faulty = with_faults(healthy, settings.faults)
    recording = simulate(faulty, excitation, **options, seed=np.random.default_rng(seed))
    document = {**truth(healthy, faults=settings.faults), **options, "excitation": str(excitation)}
    return SimulatedRun(recording, document)


def drive_document(settings: DriveSettings) -> dict[str, Any]:
    """Return the settings of a drive as further keys of its `sprung.truth/1`."""
    return {
        "duration": settings.duration,
        "sampling_rate": settings.sampling_rate,
        "snr": settings.snr,
        "noise_band": None,
        "kind": _KINDS[type(settings)],
        "road": settings.road.road_class if isinstance(settings, RoadDrive) else None,
        "nonlinear": bool(settings.suspension.force_laws),
        "payload": math.fsum(payload.mass for payload in settings.payloads),
        "temperature": settings.suspension.temperature,
    }


def record_seeds(seed: int, n_records: int) -> list[int | list[int]]:
    """Return the seed of each record of a simulation; a single record has that of the simulation."""
    return [seed] if n_records == 1 else [[seed, number] for number in range(n_records)]


def drives_of_one_vehicle(settings: DriveSettings, n_drives: int) -> list[DriveSettings]:
    """Return the settings of consecutive drives of one vehicle; the wear of each shows from the next one on."""
    first = settings.deviations.n_drives
    return [
        replace(settings, deviations=replace(settings.deviations, n_drives=first + number))
        for number in range(n_drives)
    ]


def joint_truth(truths: Sequence[dict[str, Any]], *, seed: int) -> dict[str, Any]:
    """Return the joint truth of all records of a simulation: that of the first, with the speed of each drive.

    Where the faults differ between records, as with wear, they are under `faults_by_record`.

    Parameters
    ----------
    truths
        Truth of each record, at least one.
    seed
        Seed of the simulation.
    """
    document = {**truths[0], "seed": seed}
    if len(truths) > 1 and document["speed"] is not None:
        document["speeds"] = [truth["speed"] for truth in truths]
    changes = [truth.get("faults") for truth in truths]
    if any(change != changes[0] for change in changes):
        document["faults_by_record"] = changes
    return document
