"""What rigid axles and side forces of tyres are worth in the model of a vehicle: its modes and its misfit to a drive.

    python -m benchmarks.multibody.sway bus
    python -m benchmarks.multibody.sway car --effects

A drive of five minutes, fitted with the true masses and rates of the vehicle in place of a file, three times: wheels
that move each by itself, rigid axles where the vehicle has them, and these with side forces at the mean speed. The
modes are those of the model before the fit, beside those of the engine. With `--effects` the last of these meets what
no file states, one effect at a time.
"""

import argparse
import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.multibody.__main__ import Study, ordinary, recording, sheet_file
from benchmarks.multibody.design import DESIGNS, QUIET, Axle, Effects
from benchmarks.multibody.drive import RELAXATION
from benchmarks.multibody.truth import modes, rates, roll_centre

from sprung.likelihood.fitting import fit_windows
from sprung.vehicles import Vehicle
from sprung.vehicles.models import structure
from sprung.vehicles.window import window_of

SEAT = 0.66  # distance of the springs of a rigid axle from the middle, over half the track
GYRATION = 0.75  # radius of gyration of a rigid axle in roll, over half the track
LOAD = 100.0  # of driver and luggage, about [kg]
HIGHEST = 3.0  # of the modes shown [Hz]
SEED = 100


def true_file(study: Study, *, has_rigid_axles: bool, has_side_forces: bool = False) -> Vehicle:
    """Return the vehicle file with true masses, inertias, and rates at the wheels."""
    design, sheet = study.design, sheet_file(study.design)
    true = rates(design, study.effects)
    axles = []
    for axle, part in zip(sheet.axle, design.axles, strict=True):
        at_wheel = true[f"{part.name}_left"]
        fields: dict[str, float | None] = {
            **dict.fromkeys(("contact_half_track", "wheelset_mass", "wheelset_roll_inertia")),
            "half_track": part.half_track,
            "unsprung_mass": part.wheel_mass,
            "spring_stiffness": at_wheel.spring,
            "damping": at_wheel.damper,
            "tyre_stiffness": part.tyre,
            "anti_roll_stiffness": part.bar,
        }
        if part.linkage == "rigid":  # both wheels together; one alone meets a softer spring
            fields |= {"spring_stiffness": part.spring, "damping": part.damper}
            fields |= _rigid(part) if has_rigid_axles else {}
        fields["cornering_stiffness"] = part.cornering if has_side_forces else None
        fields["relaxation_length"] = RELAXATION * part.radius
        fields["roll_centre_height"] = roll_centre(design, study.effects, part.name)
        axles.append(axle.model_copy(update=fields))
    roll, pitch, yaw = design.inertia
    inertias = {"pitch_inertia": pitch, "roll_inertia": roll, "yaw_inertia": yaw, "height": design.height}
    body = sheet.body.model_copy(update={"mass": design.mass + LOAD, **inertias})
    return sheet.model_copy(update={"axle": tuple(axles), "body": body, "learnt": ()})


def _rigid(part: Axle) -> dict[str, float | None]:
    """Return the fields of a rigid axle with springs and dampers between its wheels."""
    mass = 2 * part.wheel_mass
    return {
        "half_track": SEAT * part.half_track,
        "contact_half_track": part.half_track,
        "unsprung_mass": None,
        "wheelset_mass": mass,
        "wheelset_roll_inertia": mass * (GYRATION * part.half_track) ** 2,
        "anti_roll_stiffness": part.bar / SEAT**2,
    }


def print_effects(study: Study) -> None:
    """Print the model error of drives with side forces and one effect each, their loads fixed to the body."""
    drive, quiet = replace(ordinary(study.design, SEED), duration=300.0), replace(QUIET, side_forces=True, noise=0.02)
    fixed = replace(drive, riders=tuple(replace(rider, frequency=None) for rider in drive.riders))
    usual = Effects()
    one_effect = {"valves": usual.valves, "friction": usual.friction, "top_mounts": True, "bump_stops": True}
    cases = {"none": (quiet, fixed), "people on seats": (quiet, drive)}
    cases |= {name: (replace(quiet, **{name: value}), fixed) for name, value in one_effect.items()}
    cases |= {"braking, curves": (replace(quiet, braking=usual.braking, cornering=usual.cornering), fixed)}
    print("| effect | model error [%] |\n|---|---|")
    for name, (effects, driven) in {**cases, "all": (usual, drive)}.items():
        own = replace(study, effects=effects)
        window = window_of(recording(own, driven, SEED), true_file(own, has_rigid_axles=True, has_side_forces=True))
        print(f"| {name} | {100 * fit_windows([window]).model_error:.1f} |", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("vehicle", choices=sorted(DESIGNS))
    parser.add_argument("--folder", type=Path, default=Path.home() / ".cache" / "sprung-multibody")
    parser.add_argument("--effects", action="store_true", help="one effect at a time")
    given = parser.parse_args()
    study = Study(DESIGNS[given.vehicle], given.folder)
    if given.effects:
        print_effects(study)
        return
    run = recording(study, replace(ordinary(study.design, SEED), duration=300.0), SEED)
    speed = float(run.samples[-1].mean())
    cases = {
        "wheels by themselves": true_file(study, has_rigid_axles=False),
        "rigid axles": true_file(study, has_rigid_axles=True),
        "rigid axles, side forces": true_file(study, has_rigid_axles=True, has_side_forces=True),
    }
    print(
        "| model | body modes [Hz], damping ratio [%] | model error [%] | springs, dampers, tyres, fitted over true |"
    )
    print("|---|---|---|---|")
    for name, vehicle in cases.items():
        fit = fit_windows([window_of(run, vehicle)])
        exact = structure(vehicle, speed=speed).modes()
        rolls = np.real(exact.mode_shapes[:, 0] * exact.mode_shapes[:, 1].conj()) < 0  # left against right, in front
        ratios = [
            np.exp([ratio for part, ratio in zip(fit.components, fit.log_ratios, strict=True) if part.kind == kind])
            for kind in ("spring", "damper", "tyre")
        ]
        spread = ", ".join(f"{each.min():.2f} to {each.max():.2f}" for each in ratios)
        shown = _modes(exact.natural_frequency, exact.damping_ratio, rolls)
        print(f"| {name} | {shown} | {100 * fit.model_error:.1f} | {spread} |", flush=True)
    true = modes(study.design, study.effects, speed=speed)
    rows = [(mode.frequency, mode.damping_ratio, mode.shares["roll"] > 0.5) for mode in true]
    print(f"| the engine | {_modes(*zip(*rows, strict=True))} | | |")


def _modes(frequencies: Iterable[float], ratios: Iterable[float], rolls: Iterable[bool]) -> str:
    shown = zip(frequencies, ratios, rolls, strict=True)
    return ", ".join(f"{'roll ' if is_roll else ''}{f:.2f} {100 * xi:.0f}" for f, xi, is_roll in shown if f < HIGHEST)


if __name__ == "__main__":
    main()
