"""Standard deviations that hold the slow variation of a system, between parts of a record and between records."""

import numpy as np

from sprung._arrays import Indices, Real

#: Number of parts of a record that are compared, fewest blocks in a part, and fewest blocks that show a deviation.
N_PARTS, _BLOCKS_OF_A_PART, _FEWEST_BLOCKS = 8, 2, 4
#: Ratios of the variance of parts to that by chance, and their probabilities before any data: chance alone with
#: probability 0.7, larger ratios less in proportion to their root.
_RATIOS = np.concatenate([[1.0], np.geomspace(1.1, 100.0, 40)])
_PRIOR = np.concatenate([[0.7], 0.3 * _RATIOS[1:] ** -0.5 / np.sum(_RATIOS[1:] ** -0.5)])


def deviation_of_mean(influences: Real, records: Indices | None = None) -> Real:
    """Return standard deviations of estimates from the influence of each block of the data on them.

    Parameters
    ----------
    influences
        Change of each estimate with each block, in the order of time, shape (blocks, values), scaled so that their
        squares add up to the variance of the estimate if blocks are independent.
    records
        Rising number of the record of each block, shape (blocks,); None: one record.

    Returns
    -------
    numpy.ndarray
        Standard deviations, shape (values,); NaN for fewer than four blocks.

    Notes
    -----
    Speed, level, load and temperature vary slowly, and with them the system: neighbouring blocks then deviate to the
    same side, and the variance of sums over eight parts of the record, or over records, exceeds that of single blocks.
    With r the ratio of both and n degrees of freedom of the former, the true ratio has the likelihood
    rho^(-n/2) exp(-n r / (2 rho)); the variance is multiplied by its mean a posteriori. A priori chance alone acts
    (rho = 1) with probability 0.7; otherwise ln rho, up to ln 100, has a density in proportion to rho^(-1/2). For few
    blocks the variance is that of Student's distribution. A variation slower than the record is not in it, with a
    single record.

    References
    ----------
    W. K. Newey and K. D. West (1987), A simple, positive semi-definite, heteroskedasticity and autocorrelation
    consistent covariance matrix, Econometrica 55, 703-708 (the problem).
    """
    influences = np.asarray(influences, dtype=np.float64)
    n_blocks = len(influences)
    if n_blocks < _FEWEST_BLOCKS:
        return np.full(influences.shape[1:], np.nan)
    numbers = np.zeros(n_blocks, dtype=np.intp) if records is None else np.unique(records, return_inverse=True)[1]
    variance = np.sum(influences**2, axis=0) * (n_blocks - 1) / (n_blocks - 3)
    n_records = int(numbers.max()) + 1
    if n_blocks >= N_PARTS * _BLOCKS_OF_A_PART:
        variance = variance * _growth(influences, _parts(numbers), variance)
    if n_records > 1:
        variance = variance * _growth(influences, numbers, variance)
    return np.asarray(np.sqrt(variance))


def _parts(records: Indices) -> Indices:
    """Return the number of the part of each block: about eight in all, none of which reaches over two records."""
    n_records = int(records[-1]) + 1
    of_a_record = max(1, -(-N_PARTS // n_records))
    parts = np.zeros(len(records), dtype=np.intp)
    for record in range(n_records):
        rows = np.flatnonzero(records == record)
        count = max(1, min(of_a_record, len(rows) // _BLOCKS_OF_A_PART))
        parts[rows] = np.arange(len(rows)) * count // len(rows) + (parts[rows[0] - 1] + 1 if record else 0)
    return parts


def _growth(influences: Real, groups: Indices, variance: Real) -> Real:
    """Return the mean a posteriori of the variance of sums over groups of blocks over a variance by chance."""
    n_groups = int(groups.max()) + 1
    sums = np.zeros((n_groups, *influences.shape[1:]))
    np.add.at(sums, groups, influences)
    sums -= np.bincount(groups)[:, None] / len(groups) * sums.sum(axis=0)
    degrees = n_groups - 1
    among = np.sum(sums**2, axis=0) * n_groups / degrees
    ratio = among / np.maximum(variance, np.finfo(float).tiny)
    log_likelihood = -degrees / 2 * (np.log(_RATIOS)[:, None] + ratio / _RATIOS[:, None])
    weights = _PRIOR[:, None] * np.exp(log_likelihood - log_likelihood.max(axis=0))
    return np.asarray(np.sum(weights * _RATIOS[:, None], axis=0) / weights.sum(axis=0))
