"""The core's passes over records that tests make, and their twins in NumPy."""

from typing import NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.qp.program import StageQp, StageShape

SERIES = np.dtype([("first", np.uintp), ("stride", np.int64)])

_pointers = (core.POINTER, core.POINTER, core.POINTER)
_factorise = core.function("hdv_factorise", *_pointers, core.INT, core.INT, returns=core.INT)
_sweep_back = core.function("hdv_sweep_back", *_pointers, core.INT)
_sweep_ahead = core.function("hdv_sweep_ahead", *_pointers, core.INT, core.INT, core.INT)


def recursion_of(shape: StageShape) -> Records:
    """Return the memory of a recursion, (N+1,) records."""
    n, m = shape.states, shape.inputs
    sizes = {"P": (n, n), "p": (n,), "K": (m, n), "k": (m,), "L": (m, m)}
    return np.zeros(shape.stages + 1, np.dtype([(name, float, size) for name, size in sizes.items()]))


def weights_of(qp: StageQp) -> Records:
    """Return a copy of a program's own weights, (N+1,) records."""
    n, m = qp.shape.states, qp.shape.inputs
    sizes = {"Q": (n, n), "q": (n,), "R": (m, m), "r": (m,)}
    weights = np.zeros(qp.shape.stages + 1, np.dtype([(name, float, size) for name, size in sizes.items()]))
    for name in sizes:
        weights[name] = qp.stages[name]
    return weights


def motion_of(shape: StageShape) -> Records:
    """Return memory for states and inputs, (N+1,) records."""
    return np.zeros(shape.stages + 1, np.dtype([("x", float, (shape.states,)), ("u", float, (shape.inputs,))]))


def series(records: Records, name: str) -> Records:
    """Return where a column begins, and how many numbers lie from stage to stage."""
    return np.array([(records[name].ctypes.data, records.itemsize // 8)], SERIES)


def factorise(qp: StageQp, weights: Records, work: Records, end: int, *, affine: bool = True) -> bool:
    """Run the recursion from stage ``end`` down; return False where an input has no curvature."""
    return bool(_factorise(qp.address, core.address(series(weights, "Q")), core.address(work), end, affine))


def sweep_back(qp: StageQp, weights: Records, work: Records, end: int) -> None:
    """Write p and k from stage ``end`` down, of homogeneous dynamics."""
    _sweep_back(qp.address, core.address(series(weights, "Q")), core.address(work), end)


def sweep_ahead(qp: StageQp, work: Records, motion: Records, begin: int, end: int, *, affine: bool = True) -> None:
    """Write x and u of ``motion`` from its x at ``begin``."""
    _sweep_ahead(qp.address, core.address(work), core.address(series(motion, "x")), begin, end, affine)


class Stage(NamedTuple):
    """What the recursion knows of one stage."""

    P: FloatArray
    p: FloatArray
    K: FloatArray
    k: FloatArray


def gains(own: Records) -> tuple[FloatArray, FloatArray]:
    """Return K and k of u = -K x - k; what is kept of each input is by the state and the inputs before it."""
    before = np.tril(own["L"], -1) + np.eye(len(own["k"]))
    return np.linalg.solve(before, own["K"]), np.linalg.solve(before, own["k"])


def plain_recursion(qp: StageQp, weights: Records) -> list[Stage]:
    """Return the recursion of all stages but the last."""
    P, p, found = weights["Q"][-1], weights["q"][-1], []
    for A, B, c, weight in zip(qp.A[::-1], qp.B[::-1], qp.c[::-1], weights[-2::-1], strict=True):
        H, v = weight["R"] + B.T @ P @ B, weight["r"] + B.T @ (p + P @ c)
        K, k = np.linalg.solve(H, B.T @ P @ A), np.linalg.solve(H, v)
        P, p = weight["Q"] + A.T @ P @ A - A.T @ P @ B @ K, weight["q"] + A.T @ (p + P @ c) - K.T @ v
        found.append(Stage(P, p, K, k))
    return found[::-1]
