"""Covariance of the standard draws of a stack, entry by entry, by its definition."""

from __future__ import annotations

import numpy as np

from rverror.tolerances.sampling_rule import SamplingRule
from rverror.tolerances.stacking import Stack


def of_rule(rule: SamplingRule) -> np.ndarray:
    """Shape (instances * terms, instances * terms).

    Random phases leave the variance of a component, for it is half the mean square length.
    """
    same = np.equal.outer(rule.alike, rule.alike)
    among = (1 - rule.remaining_correlation) * np.eye(rule.instances) + rule.remaining_correlation * same
    return rule.distribution.variance * np.kron(among, np.eye(rule.terms))


def of_stack(stack: Stack) -> np.ndarray:
    """Shape (m, m)."""
    matrix = np.zeros((stack.influence.shape[0],) * 2)
    for rule in stack.rules:
        matrix[rule.components, rule.components] = of_rule(rule)
    return matrix if stack.dependence is None else matrix + stack.dependence.between
