"""Solvers as no benchmark should meet them unprepared. They pickle: a worker process makes them."""

import ctypes
import time
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, Status
from hdvplan.solvers.riccati import RiccatiWorkspace

Vice = Literal["wrong", "without multipliers", "sleeping", "crashing", "raising", "not a number", "nothing", "greedy", "lazy"]


@dataclass(frozen=True)
class Fake:
    """Makes workspaces with a vice that shows after ``honest`` solves."""

    vice: Vice
    honest: int = 0

    def __call__(self, shape: StageShape) -> "FakeWorkspace":
        """Make one."""
        return FakeWorkspace(shape, self)


class FakeWorkspace:
    """Solves by riccati, and then does something else; sure of itself throughout."""

    starts_warm = False

    def __init__(self, shape: StageShape, fake: Fake) -> None:
        """Set the honest solver up."""
        self.name = fake.vice
        self._solver, self._fake, self._solved = RiccatiWorkspace(shape), fake, 0

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve, or pretend to."""
        self._solved += 1
        if self._solved <= self._fake.honest:
            return self._solver.solve(qp, guess)
        match self._fake.vice:
            case "wrong":  # the optimum of a program with another price of steering
                qp = StageQp(qp.shape, qp.buffer.copy())
                qp.R[:] *= 300.0
            case "sleeping":
                time.sleep(3600.0)
            case "lazy":
                time.sleep(2e-3)
            case "crashing":
                ctypes.string_at(0)
            case "raising":
                msg = "no licence\nfor this machine"
                raise RuntimeError(msg)
            case "nothing":
                return None  # type: ignore[return-value] # as a careless author might
            case "greedy":
                np.ones(int(1e12))
        result = self._solver.solve(qp, guess)
        if self._fake.vice == "not a number":
            result.point.x[:] = np.nan
        if self._fake.vice == "without multipliers":
            for part in (result.point.dynamics, result.point.rows, result.point.x_bounds, result.point.u_bounds):
                part[:] = 0.0
        return result._replace(status=Status.SOLVED)
