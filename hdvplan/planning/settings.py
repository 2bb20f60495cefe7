"""The settings of planning, validated once, and the rules by which states are predicted from a planned curvature.

A rule says where the state is one station ahead, z_next = z + step * F(z, z_next, kappa), and how that changes with z and kappa. To add
one: a member of ``Discretisation``, and its branch in ``hdv_advance`` and ``linearise_interval`` of ``hdvplan/core/dynamics.c``.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from hdvplan import core
from hdvplan.errors import OptionError


class Discretisation(StrEnum):
    """The rules."""

    MIDPOINT = "midpoint"  # explicit midpoint rule: agrees with the simulation to millimetres at 0.5 m
    EULER = "euler"  # as in [GEO]
    GAUSS = "gauss"  # implicit midpoint rule: Gauss-Legendre collocation at one point, half the error of the explicit one

    @property
    def code(self) -> int:
        """The rule as the core takes it."""
        return _CODES[self]


_CODES = {rule: core.number(f"HDV_{rule.name}") for rule in Discretisation}

SHORTEST_STEP_M = 0.01  # below the accuracy that limits are judged with; a road has a station every step
MOST_STAGES = 20_000  # of one horizon: ten times what was ever measured, and what memory holds


class Scheme(StrEnum):
    """How often a planning step linearises and solves."""

    RTI = "rti"  # real-time iteration: once, from the shifted last plan; again only where a limit would be broken
    SQP = "sqp"  # to convergence


@dataclass(frozen=True)
class PlannerSettings:
    """All settings of a planner. Lengths are in metres.

    Raises:
        OptionError: a value outside its range, or lengths that do not divide.

    """

    scheme: Scheme = Scheme.RTI
    horizon: float = 100.0  #: how far each plan looks ahead [m]
    step: float = 0.5  #: distance between stations [m]
    replan: float = 5.0  #: distance driven before the next plan [m]
    smoothness: float = 1e3  #: w_kappa, the weight of (kappa_i - kappa_{i-1})^2 against squared metres [m^4]
    discretisation: Discretisation = Discretisation.MIDPOINT
    clearance: float = 0.0  #: room to keep from every limit and obstacle [m]
    give_way: float = 0.0  #: by which limits and obstacles give way to plans, never to the judge [m]
    elastic_weight: float = 1e4  #: exact penalty on a limit's violation [1/m]; above any multiplier seen on feasible roads
    elastic_growth: float = 1e5  #: growth of the price with depth [1/m^2]: many shallow violations are cheaper than a deep one
    overhang_cost: float = 1.0  #: weight of an overhang's squared reach beyond the wheels' limit, relative to the squared centring error
    sqp_tolerance: float = 1e-4  #: SQP ends when no state moves further [m, rad]
    sqp_iterations: int = 50  #: most iterations of a plan
    rti_repairs: int = 6  #: most further QPs of an RTI plan that would break a limit

    def __post_init__(self) -> None:
        """Refuse what cannot be planned with."""
        for name in ("horizon", "step", "replan", "smoothness", "elastic_weight", "sqp_tolerance", "sqp_iterations"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                msg = f"{name} must be a positive number, not {value:g}"
                raise OptionError(msg)
        for name in ("clearance", "give_way", "elastic_growth", "overhang_cost", "rti_repairs"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                msg = f"{name} must be zero or a positive number, not {value:g}"
                raise OptionError(msg)
        for name in ("horizon", "replan"):
            ratio = getattr(self, name) / self.step
            if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:  # noqa: PLR2004 - rounding of decimal inputs
                msg = f"{name} {getattr(self, name):g} m is not a whole number of steps of {self.step:g} m"
                raise OptionError(msg, hint="choose a step that divides both the horizon and the replanning distance")
        if self.step < SHORTEST_STEP_M or self.stages > MOST_STAGES:
            least = f"a step has at least {SHORTEST_STEP_M:g} m, a horizon at most {MOST_STAGES} steps"
            msg = f"steps of {self.step:g} m over {self.horizon:g} m: {least}"
            raise OptionError(msg, hint="choose a larger --step or a shorter --horizon")
        if self.replan > self.horizon:
            msg = f"the replanning distance {self.replan:g} m is longer than the horizon {self.horizon:g} m"
            raise OptionError(msg)
        if self.stages < 2:  # noqa: PLR2004 - a horizon of one interval has nothing to plan
            msg = f"a horizon of {self.horizon:g} m has only one step of {self.step:g} m"
            raise OptionError(msg)

    @cached_property
    def stages(self) -> int:
        """Intervals in one horizon, N."""
        return round(self.horizon / self.step)

    @cached_property
    def executed(self) -> int:
        """Intervals executed before the next plan."""
        return round(self.replan / self.step)
