"""Terms of a vehicle's spectral matrix, which the blocks of parameters contribute to."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Complex, Real
from sprung.likelihood.coordinates import RigidLayout
from sprung.likelihood.spectra import ClassSpectra
from sprung.vehicles import Structure


@dataclass(frozen=True, eq=False, slots=True)
class Terms:
    """Terms of the spectral matrix: the vehicle, its sensors, its inputs and the noise.

    Parameters
    ----------
    frequencies
        Frequencies of the model [Hz], shape (grid,): `ClassSpectra.grid`.
    elongations
        Elongation of each element for one unit of each coordinate, shape (elements, n).
    feet
        1 where an input moves the foot of an element, shape (elements, inputs).
    reduction
        Coordinates of the data for one unit of each channel, shape (coordinates, channels).
    stiffness
        Dynamic stiffness of each element [N/m], shape (elements, grid).
    rolling
        Dynamic stiffness of wheels that roll on rails or of a body that turns on tyres, shape (grid, n, n).
    mass
        Mass matrix, in kg and kg m^2, shape (n, n).
    forces
        Generalised force of one unit of each input that acts as a force, shape (n, inputs).
    motion
        Acceleration that each channel reads for one unit of acceleration of each coordinate, shape (channels, n).
    feedthrough
        Direct reading of each channel for one unit of each input, shape (channels, inputs).
    channel_response
        Frequency response of each channel, shape (grid, channels): 1 for a perfect one.
    inputs
        One-sided spectral matrix of the inputs of the wheels, shape (classes, grid, wheels, wheels).
    measured_inputs
        Spectral matrix of further inputs that are independent of those of the wheels (such as the accelerations of
        braking and cornering, or that of the vehicle ahead), shape (classes, grid, measured, measured). `feet`,
        `forces` and `feedthrough` have their columns after those of the wheels.
    noise
        Spectral matrix of the noise in the coordinates of the data, shape (grid, coordinates, coordinates).

    Notes
    -----
    With D(f) = -w^2 M + sum over elements z d d^T + rolling and B(f) = forces + sum z d foot^T (w = 2 pi f, z the
    dynamic stiffness, d the elongations):

        H = reduction diag(channel response) (-w^2 motion D^-1 B + feedthrough),    S = H S_inputs H^H + noise,

    S_inputs block diagonal of `inputs` and `measured_inputs`.

    References
    ----------
    D. J. Ewins, Modal Testing: Theory, Practice and Application, 2nd edition, Research Studies Press, 2000 (frequency
    response functions).
    """

    frequencies: Real
    elongations: Real
    feet: Real
    reduction: Real
    stiffness: Complex
    rolling: Complex
    mass: Real
    forces: Real
    motion: Real
    feedthrough: Real
    channel_response: Complex
    inputs: Complex
    measured_inputs: Complex
    noise: Complex

    @property
    def s(self) -> Complex:
        """Complex angular frequencies i w, shape (grid,)."""
        return np.asarray(2j * np.pi * self.frequencies, dtype=np.complex128)

    @property
    def squared(self) -> Real:
        """Squared angular frequencies w^2, shape (grid,)."""
        return np.asarray((2 * np.pi * self.frequencies) ** 2, dtype=np.float64)


def nominal_terms(structure: Structure, layout: RigidLayout, spectra: ClassSpectra) -> Terms:
    """Return the terms of a nominal vehicle with perfect sensors, inputs of 0 and no noise.

    Parameters
    ----------
    structure
        Nominal vehicle.
    layout
        Coordinates of the data.
    spectra
        Data whose frequencies and classes the terms have.

    References
    ----------
    D. J. Ewins, Modal Testing: Theory, Practice and Application, 2nd edition, Research Studies Press, 2000 (frequency
    response functions).
    """
    grid = spectra.grid
    s = np.asarray(2j * np.pi * grid, dtype=np.complex128)
    n_coordinates, n_inputs = len(layout.reduction), len(structure.inputs)
    return Terms(
        frequencies=grid,
        elongations=structure.elongations,
        feet=structure.feet,
        reduction=layout.reduction,
        stiffness=np.array([element.dynamic_stiffness(s) for element in structure.elements]),
        rolling=structure.rolling_at(s),
        mass=structure.mass,
        forces=structure.forces,
        motion=layout.motion,
        feedthrough=np.zeros((len(layout.names), n_inputs)),
        channel_response=np.ones((grid.size, len(layout.names)), dtype=np.complex128),
        inputs=np.zeros((spectra.counts.size, grid.size, n_inputs, n_inputs), dtype=np.complex128),
        measured_inputs=np.zeros((spectra.counts.size, grid.size, 0, 0), dtype=np.complex128),
        noise=np.zeros((grid.size, n_coordinates, n_coordinates), dtype=np.complex128),
    )
