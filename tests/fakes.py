"""Solvers as no benchmark should meet them unprepared. They pickle: a worker process makes them."""

import ctypes
import sys
import time
from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np

from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, Status
from hdvplan.solvers.riccati import RiccatiWorkspace

Fault = Literal[
    "wrong", "without multipliers", "sleeping", "crashing", "raising", "not a number", "nothing", "greedy", "slow", "leaving", "panicking",
    "another shape", "infinite", "giving up", "unmoved",
]  # fmt: skip


@dataclass(frozen=True)
class Fake:
    """Makes workspaces with a fault that shows after ``honest`` solves; in every ``often``-th of those that follow."""

    fault: Fault
    honest: int = 0
    often: int = 1

    def __call__(self, shape: StageShape) -> "FakeWorkspace":
        """Make one."""
        return FakeWorkspace(shape, self)


class PanicError(BaseException):
    """What solvers that are compiled from Rust raise: no Exception."""


class FakeWorkspace:
    """Solves by riccati, and then does something else; sure of itself throughout."""

    starts_warm = False

    def __init__(self, shape: StageShape, fake: Fake) -> None:
        """Set the honest solver up."""
        self.name = fake.fault
        self._solver, self._fake, self._solved = RiccatiWorkspace(shape), fake, 0

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve, or pretend to."""
        self._solved += 1
        if self._solved <= self._fake.honest or self._solved % self._fake.often:
            return self._solver.solve(qp, guess)
        match self._fake.fault:
            case "wrong":  # the optimum of a program with another price of steering
                qp = qp.copy()
                qp.R[:] *= 300.0
            case "sleeping":
                time.sleep(3600.0)
            case "slow":
                began = time.process_time()
                while time.process_time() < began + 2e-3:
                    pass
            case "crashing":
                ctypes.string_at(0)
            case "raising":
                msg = "no licence\nfor this machine"
                raise RuntimeError(msg)
            case "nothing":
                return None  # type: ignore[return-value] # as a careless author might
            case "greedy":
                np.ones(int(1e12))
            case "leaving":
                sys.exit()
            case "panicking":
                msg = "index out of bounds"
                raise PanicError(msg)
            case "another shape":
                longer = StageShape(**{**asdict(qp.shape), "stages": qp.shape.stages + 1})
                return QpResult(Status.SOLVED, StageSolution.empty(longer), 1, 0.0, 0.0)
            case "unmoved":
                return QpResult(Status.SOLVED, StageSolution.empty(qp.shape), 1, 0.0, 0.0)
        result = self._solver.solve(qp, guess)
        if self._fake.fault == "not a number":
            result.point.x[:] = np.nan
        if self._fake.fault == "infinite":
            result.point.u[:] = np.inf
        if self._fake.fault == "giving up":
            result.point.x[2:] += 0.01
            return result._replace(status=Status.ITERATION_LIMIT, reason="500 iterations")
        if self._fake.fault == "without multipliers":
            for part in (result.point.dynamics, result.point.rows, result.point.x_bounds, result.point.u_bounds):
                part[:] = 0.0
        return result._replace(status=Status.SOLVED)
