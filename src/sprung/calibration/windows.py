"""Windows of a vehicle as the data of its calibration: spectra of all channels, and the model of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Real
from sprung.calibration.block import FileNumbers
from sprung.calibration.draft import Draft, VehicleNumber
from sprung.calibration.joint import JointModel, joint_model
from sprung.errors import DataError
from sprung.likelihood import (
    ClassSpectra,
    CornerSettings,
    Model,
    RigidLayout,
    SegmentSpectra,
    rigid_layout,
    segment_spectra,
    vehicle_model,
)
from sprung.likelihood.fitting import FitSetup
from sprung.likelihood.spectra import delayed_speeds, segment_speeds, steady_segments
from sprung.likelihood.speed_delay import DELAYS, speed_delay
from sprung.likelihood.vehicle import Kind, default_choices, with_sensors
from sprung.vehicles import Vehicle, structure
from sprung.vehicles.window import Window

#: Groups of parameters of a usual fit that the numbers of the file replace.
_REPLACED = frozenset({"components", "elements", "sensors", "unsprung"})
#: Parameters of the road that are the vehicle's: the ratio of the delays between the axles, a matter of wheelbase and
#: speedometer.
DELAY = "delay"
#: Noise of a channel at the start of a search over its power.
_NOISE = 0.01


@dataclass(frozen=True, eq=False, slots=True)
class WindowSpectra:
    """Spectra of the segments of a window, in all its channels.

    Parameters
    ----------
    segments
        Spectra of the segments; the coordinates are the channels.
    layout
        Channels.
    rigid
        Combinations of the channels that the vehicle of the file explains.
    kind
        Excitation of the wheels.
    """

    segments: SegmentSpectra
    layout: RigidLayout
    rigid: RigidLayout
    kind: Kind


def window_spectra(window: Window, settings: CornerSettings) -> WindowSpectra:
    """Return the spectra of a window.

    Parameters
    ----------
    window
        Recording with its vehicle file.
    settings
        Band and length of the segments.

    Raises
    ------
    DataError
        If the speed is missing, or no segment is long, fast and steady enough.
    ParameterError
        If no sensor observes a motion of the vehicle.

    Notes
    -----
    A fit of the corners leaves out what a rigid vehicle cannot explain; here it shows where sensors are. A speed
    channel that is late is corrected, as there.
    """
    kind: Kind = settings.kind or window.vehicle.kind
    if window.speed is None and kind != "rig":
        raise DataError(
            f"calibration needs the speed, but the channel {window.vehicle.speed_channel!r} is missing or wrong: "
            "record it"
        )
    motion = window.motion
    layout, rigid = window_layouts(window.vehicle, motion.names)
    band, length = default_choices(window.vehicle, window.structure, settings, motion.sampling_rate)
    segments = segment_spectra([motion], layout, speed=None, band=band, segment_length=length)
    if kind == "rig" or window.speed is None:
        return WindowSpectra(segments, layout, rigid, kind)
    setup = FitSetup(window.vehicle, window.structure, layout, settings, kind)
    means, variations = delayed_speeds([motion], window.speed, length, DELAYS)
    late = speed_delay(segments, means, variations, lambda speeds: setup.at_speeds(segments, speeds)).value
    speeds = segment_speeds([motion], window.speed, length, delay=late)
    return WindowSpectra(steady_segments(segments, *speeds), layout, rigid, kind)


def window_layouts(vehicle: Vehicle, channels: tuple[str, ...]) -> tuple[RigidLayout, RigidLayout]:
    """Return the layouts of all channels, and of what the vehicle of the file explains in them.

    Parameters
    ----------
    vehicle
        Vehicle as its file describes it.
    channels
        Names of the channels that were recorded.

    Raises
    ------
    ParameterError
        If no sensor observes a motion of the vehicle.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> channels, rigid = window_layouts(read_vehicle("zafira"), ("acc_fl", "acc_fr", "acc_rl", "acc_rr"))
    >>> channels.coordinates, rigid.coordinates
    (('acc_fl', 'acc_fr', 'acc_rl', 'acc_rr'), ('bounce', 'pitch', 'roll'))
    """
    rigid = rigid_layout(with_sensors(structure(vehicle), channels))
    return of_all_channels(rigid), rigid


def of_all_channels(layout: RigidLayout) -> RigidLayout:
    """Return a layout whose coordinates are the channels, each over its usual noise; nothing is left out."""
    if len(layout.reduction) == len(layout.names):
        return layout
    weights = np.sqrt(np.einsum("cii->c", layout.noise))
    usual = np.array([np.linalg.norm(column) for column in layout.reduction.T]) / np.where(weights > 0, weights, 1.0)
    unit = np.eye(len(layout.names))
    return replace(
        layout, coordinates=layout.names, reduction=np.diag(usual), noise=np.einsum("ci,cj->cij", unit, unit)
    )


def window_model(
    spectra: ClassSpectra,
    window: WindowSpectra,
    draft: Draft,
    numbers: tuple[VehicleNumber, ...],
    settings: CornerSettings,
) -> Model:
    """Return the model of a window with the numbers of the file, the payload, the road and the noise as parameters.

    Parameters
    ----------
    spectra
        Mean spectral matrices of the window's segments.
    window
        Channels and excitation.
    draft
        Vehicle as given.
    numbers
        Numbers of the file to learn.
    settings
        Further choices.
    """
    usual = vehicle_model(spectra, window.layout, draft.vehicle, draft.structure(), settings=settings, kind=window.kind)
    rest = tuple(block for block in usual.blocks if block.group not in _REPLACED)
    return Model(usual.structure, window.layout, spectra, (FileNumbers(draft, numbers, window.layout), *rest))


def joint_of(models: Sequence[Model]) -> JointModel:
    """Return the joint model of windows of one vehicle: the numbers of the file and the delays are shared."""
    numbers = next(block for block in models[0].blocks if isinstance(block, FileNumbers))
    return joint_model(models, shared={*numbers.names, DELAY})


def scaled_start(joint: JointModel) -> Real:
    """Return the start of a search: numbers as given, inputs of each window at the power of its data.

    The noise of every channel starts at a hundredth of the channel's power, so that sensors that are not where the file
    says do not rule the first steps.
    """
    start = joint.start.copy()
    for model, rows in zip(joint.models, joint.rows, strict=True):
        own = model.scaled_start()
        own[model.rows("noise")] = _usual_noise(model)
        start[rows] = own
    return start


def _usual_noise(model: Model) -> Real:
    """Return ln of the noise densities at which each channel has a hundredth of its power as noise."""
    layout, spectra = model.layout, model.spectra
    if len(layout.reduction) != len(layout.names) or layout.coordinates != layout.names:
        return np.asarray(model.scaled_start()[model.rows("noise")], dtype=np.float64)
    colours = (2 * np.pi * spectra.frequencies[:, None]) ** (2 * (2 - layout.orders))
    power = np.einsum("cfii->fi", spectra.matrices).real / spectra.counts.size
    return np.log(_NOISE * np.median(power / colours, axis=0))
