"""Values that chance exceeds with a given probability, from scipy.special: scipy.stats takes far longer to load."""

from __future__ import annotations

import scipy


def chi_square(probability: float, freedom: float) -> float:
    """Value that a chi-square variable of so many degrees of freedom exceeds with a probability.

    Examples
    --------
    >>> round(chi_square(0.05, 2), 3)  # -2 ln 0.05
    5.991
    """
    return float(scipy.special.chdtri(freedom, probability))


def variance_ratio(probability: float, above: float, below: float) -> float:
    """Value that an F variable of `above` and `below` degrees of freedom exceeds with a probability.

    Examples
    --------
    >>> round(variance_ratio(0.05, 1, 1e9) - chi_square(0.05, 1), 6)
    0.0
    """
    return float(scipy.special.fdtri(above, below, 1.0 - probability))


def student(probability: float, freedom: float) -> float:
    """Value that a Student variable of so many degrees of freedom exceeds with a probability.

    Examples
    --------
    >>> round(student(0.025, 1e9), 3)
    1.96
    """
    return -float(scipy.special.stdtrit(freedom, probability))
