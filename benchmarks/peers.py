"""The peers' covariance-driven SSI, called as their documentation does."""

import contextlib
import io
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Ready-made clusterings of pyOMA2, by the names its documentation gives them.
PYOMA_PRESETS = (
    "Magalhaes", "Reynders", "Neu", "Kvaale", "Dederichs", "hdbscan",
    "affinity", "spectral", "optics", "hier_avg", "hier_sing", "hier_sing_nodc",
)  # fmt: skip


def pyoma_ssi(
    samples: Array, sampling_rate: float, *, block_rows: int, max_order: int, **options: Any
) -> tuple[Any, Any]:
    """Return pyOMA2's algorithm after its run, with poles and labels, and the set-up that holds it."""
    from pyoma2.algorithms import SSI
    from pyoma2.setup import SingleSetup

    setup = SingleSetup(samples.T, fs=sampling_rate)
    algorithm = SSI(name="ssi", br=block_rows, ordmax=max_order, **options)
    setup.add_algorithms(algorithm)
    setup.run_by_name("ssi")
    return algorithm, setup


def pyoma_modes(algorithm: Any, preset: str) -> tuple[Array, Array]:
    """Return frequencies and damping ratios of the modes that a preset selects."""
    from pyoma2.algorithms.data.run_params import Clustering

    algorithm.add_clustering(Clustering(name=preset, quick=preset))
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        algorithm.run_clustering(preset)
    found = algorithm.result.clustering_results[preset]
    return np.asarray(found.Fn), np.asarray(found.Xi)


def koma_ssi(samples: Array, sampling_rate: float, *, block_rows: int, orders: Array) -> tuple[Array, ...]:
    """Return poles, shapes and orders of koma's covssi."""
    from koma.oma import covssi

    poles, shapes, pole_orders = covssi(samples.T, sampling_rate, block_rows, orders, showinfo=False)
    return poles, shapes, pole_orders


def koma_stable(poles: Array, shapes: Array, orders: Array, *, n_levels: int = 1) -> tuple[Array, ...]:
    """Return koma's stable poles, with its default criteria, compared with `n_levels` orders below."""
    from koma.oma import find_stable_poles

    stable, stable_shapes, stable_orders, _ = find_stable_poles(poles, shapes, orders, n_levels)
    return stable, stable_shapes, stable_orders


def koma_modes(stable: Array, shapes: Array, orders: Array) -> tuple[Array, Array]:
    """Return frequencies and damping ratios of koma's clusters, with its default settings."""
    from koma.clustering import PoleClusterer, group_clusters

    if len(stable) < 20:
        return np.zeros(0), np.zeros(0)
    clusters = PoleClusterer(stable, shapes, orders).postprocess()
    if not len(clusters[0]):
        return np.zeros(0), np.zeros(0)
    damping, omega, *_ = group_clusters(*clusters)
    return np.array([np.median(w) for w in omega]) / (2 * np.pi), np.array([np.median(xi) for xi in damping])
