"""The settings of planning, validated once, the rules by which states are predicted from a planned curvature, and names of objectives.

A rule says where the state is one station ahead, z_next = z + step * F(z, z_next, kappa), and how that changes with z and kappa. To add
one: a member of ``Discretisation``, and its branch in ``hdv_advance`` and ``linearise_interval`` of ``hdvplan/core/dynamics.c``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from typing import Annotated

from hdvplan import plugins
from hdvplan.errors import OptionError
from hdvplan.settings import NOT_NEGATIVE, POSITIVE, Setting, check


class Discretisation(StrEnum):
    """The rules."""

    MIDPOINT = "midpoint"  # explicit midpoint rule: agrees with the simulation to millimetres at 0.5 m
    EULER = "euler"  # as in [GEO]
    GAUSS = "gauss"  # implicit midpoint rule: Gauss-Legendre collocation at one point, half the error of the explicit one

    @property
    def code(self) -> int:
        """The rule as the core takes it."""
        from hdvplan import core  # noqa: PLC0415 - settings are told without NumPy: --help stays quick

        return core.number(f"HDV_{self.name}")


SHORTEST_STEP_M = 0.01  # below the accuracy that limits are judged with; a road has a station every step
_FREE_M = 1e4
LARGEST = "max"  # instead of a clearance: as much as can be kept
MOST_STAGES = 20_000  # of one horizon: ten times what was ever measured, and what memory holds


class Scheme(StrEnum):
    """How often a planning step linearises and solves."""

    RTI = "rti"  # real-time iteration: once, from the shifted last plan; again only where a limit would be broken
    SQP = "sqp"  # to convergence


Horizon = Annotated[float, Setting("How far each plan looks ahead [m].", "M", above=0.0)]
Step = Annotated[float, Setting("Distance between stations [m].", "M", above=0.0)]
Replan = Annotated[float, Setting("Distance driven before the next plan [m].", "M", above=0.0)]
WEIGHTED = "art-weighted"
OBJECTIVE_NAMES = ("geometric", "balanced", "geometric-fixed", "lead-axle", "trail-axle", "axle-max", "body-max", WEIGHTED)
SIDES = "left", "right"


@dataclass(frozen=True)
class PlanOptions:
    """What is planned, and what of a plan that breaks limits, as users name it; what they bring has a name of the form below.

    Raises:
        OptionError: no such side.

    """

    solver: Annotated[
        str | None,
        Setting("A name from `hdvplan solvers`, or your own: package.module:Class, file.py:Class [default: riccati].", "NAME"),
    ] = None
    objective: Annotated[
        str,
        Setting(
            f"What the plan centres: {', '.join(OBJECTIVE_NAMES)}, {WEIGHTED}:0.45, one of an installed package, or your own: "
            "package.module:name, file.py:name.",
            "NAME",
        ),
    ] = OBJECTIVE_NAMES[0]
    bias: Annotated[
        str | None,
        Setting(
            "Where the middle of the swept area should lie [m], left positive: a number, a file with columns s,bias, or half-way between "
            "the limits.",
            "M|FILE.csv|centre",
        ),
    ] = None
    side: Annotated[
        str | None,
        Setting(
            "Pass all obstacles on the line on this side, seen in the direction of travel [default: the better side].",
            names=("--pass",),
            choices=SIDES,
        ),
    ] = None
    beside: Annotated[
        str | None,
        Setting(
            "Keep free what another plan swept, as of a bus that comes the other way: "
            "first `plan ROAD --vehicle OTHER --reverse --out DIR`, then this one with --beside DIR.",
            "DIR",
        ),
    ] = None
    meeting: Annotated[
        str | None,
        Setting(
            "With --beside: the other stays between these places, along the road as this one drives [m], until it has passed.", "FROM:TO"
        ),
    ] = None
    proof: Annotated[
        bool, Setting("If the plan breaks limits, look for a proof that no plan keeps them.", names=("--proof/--no-proof",))
    ] = True
    refine: Annotated[
        bool,
        Setting(
            "Plan again for less that is lacking, or, close to limits, for the clearance that can be kept.",
            names=("--refine/--no-refine",),
        ),
    ] = True

    def __post_init__(self) -> None:
        """Refuse a side that is none."""
        check(self)


@dataclass(frozen=True)
class PlannerSettings:
    """All settings of a planner. Lengths are in metres.

    Raises:
        OptionError: a value outside its range, or lengths that do not divide.

    """

    scheme: Annotated[Scheme, Setting("rti: the real-time iteration, one quadratic program (QP) a step; sqp: QPs to convergence.")] = (
        Scheme.RTI
    )
    horizon: Horizon = 100.0
    step: Step = 0.5
    replan: Replan = 5.0
    smoothness: Annotated[
        float,
        Setting(
            "Weight of curvature changes in the objective: more makes the steering gentler. The road's line is smoothed by --smooth.",
            "W",
            ("--curvature-weight", "--smoothness"),
            above=0.0,
            most=1e9,  # beyond it outweighs the prices of limits
        ),
    ] = 1e3  #: w_kappa, the weight of (kappa_i - kappa_{i-1})^2 against squared metres [m^4]
    discretisation: Annotated[Discretisation, Setting("Rule by which states are predicted.")] = Discretisation.MIDPOINT
    clearance: Annotated[float, Setting("Room to keep from every limit and obstacle [m].", "M", least=0.0)] = 0.0
    tracking_error: Annotated[
        float,
        Setting(
            "Lateral error of the driver, at the front axle, with which the plan must keep the street [m]; 0: none.",
            "M",
            least=0.0,
        ),
    ] = field(default=0.0, metadata={"decides": False})
    tracking_length: Annotated[
        float, Setting("Length l within which the driver returns to the path: directions are at most E / l off [m].", "M", least=1.0)
    ] = field(default=6.0, metadata={"decides": False})
    give_way: Annotated[float, NOT_NEGATIVE] = 0.0  #: by which limits and obstacles give way to plans, never to the judge [m]
    #: from and to which s of the lead axle they do, and by how much at most [m]; () everywhere. It follows from the plan that they are for
    give_way_on: tuple[tuple[float, float, float], ...] = field(default=(), metadata={"decides": False})
    elastic_weight: Annotated[float, POSITIVE] = 1e4  #: exact penalty on a limit's violation [1/m]; above any multiplier seen
    elastic_growth: Annotated[float, NOT_NEGATIVE] = 1e5  #: growth of the price [1/m^2]: many shallow violations, no deep one
    overhang_cost: Annotated[float, NOT_NEGATIVE] = 1.0  #: weight of an overhang's squared reach beyond the wheels' limit
    sqp_tolerance: Annotated[float, POSITIVE] = 1e-4  #: SQP ends when no state moves further [m, rad]
    sqp_iterations: Annotated[int, POSITIVE] = 50  #: most iterations of a plan
    rti_repairs: Annotated[int, NOT_NEGATIVE] = 6  #: most further QPs of an RTI plan that would break a limit

    def __post_init__(self) -> None:
        """Refuse what cannot be planned with."""
        check(self)
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

    @property
    def unlimited(self) -> PlannerSettings:
        """The settings of a plan that meets no limit: all give way by more than any road is wide."""
        return replace(self, give_way=_FREE_M)


def check_objective(name: str) -> None:
    """Refuse what ``objective_named`` would; of what is not the user's own nothing is loaded.

    Raises:
        OptionError: there is none of that name, it cannot be loaded, or the weight is not a number from 0 to 1.

    """
    if share_of(name) is None and name not in OBJECTIVE_NAMES and plugins.load(plugins.OBJECTIVE, name) is None:
        raise plugins.unknown(plugins.OBJECTIVE, name, objective_names())


def objective_names() -> list[str]:
    """Return all objectives that have a name: ours, and those that installed packages offer."""
    return list(dict.fromkeys([*OBJECTIVE_NAMES, *plugins.offers(plugins.OBJECTIVE)]))


def share_of(name: str) -> float | None:
    """Return the weight that a name like ``art-weighted:0.45`` gives as a number, None where it gives none.

    Raises:
        OptionError: it is not a number from 0 to 1.

    """
    known, _, text = name.partition(":")
    if known != WEIGHTED or not text:
        return None
    try:
        share = float(text)
    except ValueError:
        share = float("nan")
    if not 0.0 <= share <= 1.0:
        msg = f"the weight of {WEIGHTED!r} must be a number from 0 to 1, not {share:g}"
        raise OptionError(msg)
    return share
