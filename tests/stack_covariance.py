"""Covariance of the standard draws of a stack, entry by entry, by its definition."""

from __future__ import annotations

import numpy as np

from rverror.tolerances.blocks import Block
from rverror.tolerances.stacking import Stack


def of_block(block: Block) -> np.ndarray:
    """Shape (instances * terms, instances * terms).

    Random phases leave the variance of a component, for it is half the mean square length.
    """
    same = np.equal.outer(block.alike, block.alike)
    among = (1 - block.remaining_correlation) * np.eye(block.instances) + block.remaining_correlation * same
    return block.distribution.variance * np.kron(among, np.eye(block.terms))


def of_stack(stack: Stack) -> np.ndarray:
    """Shape (m, m)."""
    matrix = np.zeros((stack.influence.shape[0],) * 2)
    for block in stack.blocks:
        matrix[block.components, block.components] = of_block(block)
    return matrix if stack.dependence is None else matrix + stack.dependence.between
