"""Variables and rows of a program in blocks of one kind, and the order that lays them out stage by stage."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hdvplan.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Block:
    """Variables, or rows, of the same kind: ``size`` of them at each of some stages.

    ``start`` is a number, or one for every entry. Inputs are those variables that are no states, and those rows that are
    no dynamics.
    """

    stages: IntArray
    size: int
    start: FloatArray | float
    low: float = -np.inf
    high: float = np.inf
    input: bool = False


def by_stage(blocks: Sequence[Block]) -> IntArray:
    """Return the order that lays blocks out stage by stage: states before inputs, dynamics before other rows."""
    stage = np.concatenate([np.repeat(block.stages, block.size) for block in blocks])
    after = np.concatenate([np.full(len(block.stages) * block.size, block.input) for block in blocks])
    return np.lexsort((after, stage))


def counts(blocks: Sequence[Block], stages: int) -> IntArray:
    """Return how many inputs, or rows beside the dynamics, each stage has."""
    inputs = np.concatenate([np.repeat(block.stages, block.size) for block in blocks if block.input])
    return np.bincount(inputs, minlength=stages + 1)


def values_of(blocks: Sequence[Block], of: Callable[[Block], FloatArray | float]) -> FloatArray:
    """Return a number for every entry of blocks, from numbers, or arrays of all of a block's entries."""
    return np.concatenate([np.broadcast_to(np.ravel(of(block)), len(block.stages) * block.size) for block in blocks])


def taken_apart(x: ca.MX, blocks: Sequence[Block]) -> list[ca.MX]:
    """Return the blocks of a vector of variables as matrices (size, stages)."""
    ends = np.cumsum([0, *(len(block.stages) * block.size for block in blocks)])
    parts = ca.vertsplit(x, ends.tolist())
    return [ca.reshape(part, block.size, len(block.stages)) for part, block in zip(parts, blocks, strict=True)]
