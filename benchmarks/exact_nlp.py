"""The exact nonlinear program of one planning step, for CasADi with IPOPT or fatrop: it shares no linearisation with hdvplan.

Multiple shooting with the planner's own discretisation. Bodies are held at the sampled points of their edges, at stations, between
kerbs that are parallel to the road: there an offset from the road and a distance from a kerb are the same. The planner also looks
between these points, which matters where the road bends around an edge, and between stations. The feet of the auxiliary axle and
of every body point are variables of their own, each held on the road by a projection equation; the road is the same piecewise
quintic, written as a B-spline without loss.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Literal

import casadi as ca
import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from stage_blocks import Block, by_stage, counts, taken_apart, values_of

from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import Discretisation, PlannerSettings
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.centring import Centring
from hdvplan.road.path import ReferencePath, evaluate_many
from hdvplan.road.road import Road
from hdvplan.road.street import look
from hdvplan.vehicle.kinematics import axles_behind, edge_points, place_many
from hdvplan.vehicle.model import Unit, Vehicle

_DEGREE = 5
_SAME_M = 1e-9  # the B-spline must be the road to within this
_REACH_M = 25.0  # road beyond the horizon's ends on which body points may have their feet
_EVALUATIONS = ("nlp_f", "nlp_g", "nlp_grad_f", "nlp_jac_g", "nlp_hess_l")  # as CasADi's statistics name them

Method = Literal["ipopt", "fatrop"]


@dataclass(frozen=True)
class Optimum:
    """What was found, and the time of its call alone (the program was built and differentiated before)."""

    z: FloatArray  # (N+1, n)
    kappa: FloatArray  # (N,)
    solved: bool
    iterations: int
    seconds: float
    evaluating: float  # of these, in CasADi's functions and derivatives; the rest is the solver's own


@dataclass(frozen=True)
class ExactNlp:
    """A program ready to be solved from its cold start."""

    solver: ca.Function
    bounds: dict[str, ca.DM]
    places: IntArray  # of the variables, block by block
    states: int
    stages: int

    def solve(self) -> Optimum:
        """Solve from the stationary geometry of the road."""
        began = perf_counter()
        found = self.solver(**self.bounds)
        seconds = perf_counter() - began
        x, count = np.array(found["x"]).ravel()[self.places], self.states * (self.stages + 1)
        stats = self.solver.stats()
        kappa = x[count + self.stages + 1 :][: self.stages]
        evaluating = sum(float(stats[f"t_wall_{name}"]) for name in _EVALUATIONS if f"t_wall_{name}" in stats)
        z = x[:count].reshape(self.stages + 1, self.states)
        return Optimum(z, kappa, bool(stats["success"]), int(stats["iter_count"]), seconds, evaluating)


def exact_nlp(
    vehicle: Vehicle,
    road: Road,
    stations: Stations,
    goal: Goal,
    settings: PlannerSettings,
    kappa_before: float,
    *,
    tolerance: float,
    method: Method = "ipopt",
) -> ExactNlp:
    """Return the program of a drive's first plan; it starts in the stationary geometry at station 0.

    Variables and rows are in the order of stages, with the curvature before each as one more state: fatrop needs that, and IPOPT gets
    the same program.

    Raises:
        NotImplementedError: another rule than the midpoint's, axles that the plan steers, another goal than centring, or kerbs that are not
            parallel to the road.

    """
    (term,) = goal.terms
    if settings.discretisation is not Discretisation.MIDPOINT or vehicle.active or not isinstance(term, Centring):
        raise NotImplementedError
    residual = term.residual
    stages, n = settings.stages, vehicle.states
    every, moving, planned = np.arange(stages + 1), np.arange(stages), np.arange(1, stages + 1)
    ahead, geometry = slice(1, stages + 1), stations.centring
    states = np.column_stack([geometry.e_y, geometry.e_psi, geometry.beta])[: stages + 1]
    project = _projection(stations.path, float(stations.s[stages]))
    points, behind, s = stations.points, axles_behind(vehicle), stations.s[ahead]
    axle = residual.axle % len(vehicle.units)
    edges, reaches = edge_points(vehicle), _reaches(road)
    starts = (s[:, None, None] + edges["ahead"][None] - behind[None, :, None]).reshape(stages, -1)
    starts = np.repeat(starts, 2, axis=1)[:, : starts.shape[1] * 2 * len(reaches)]  # left edge, right edge
    variables = [
        Block(every, n, states),
        Block(every, 1, np.concatenate([[kappa_before], geometry.kappa[:stages]])),  # what was held until here
        Block(moving, 1, geometry.kappa[:stages], -vehicle.max_curvature, vehicle.max_curvature, input=True),
        Block(planned, 1, s + (vehicle.lead.wheelbase if axle == 0 else -behind[axle]), input=True),
        Block(planned, starts.shape[1], starts, input=True),
    ]
    order = by_stage(variables)
    x = ca.MX.sym("x", len(order))
    z, held, kappa, aux_feet, feet = taken_apart(x[np.argsort(order).tolist()], variables)

    k, between = points["curvature"][:stages], points["curvature_between"][:stages]
    reached = advance(vehicle, settings.step).map(stages)(z[:, :-1], kappa, ca.DM(k).T, ca.DM(between).T)
    placed = _placement(vehicle, axle, edges).map(stages)(
        z[:, 1:], ca.DM(np.stack([points[name][ahead] for name in ("x", "y", "cos", "sin")]))
    )
    aux_along, aux_offset = project.map(stages)(aux_feet, placed[:2, :])
    centred = ca.DM(residual.lead[ahead]).T * z[0, 1:] + ca.DM(residual.aux[ahead]).T * aux_offset - ca.DM(residual.target[ahead]).T
    change, rate = kappa - held[:, :-1], vehicle.max_curvature_rate * settings.step
    cost = settings.smoothness * ca.sumsqr(change) + ca.sumsqr(centred)
    first = np.zeros(1, dtype=np.int64)
    rows = [
        (Block(moving, n, 0.0, 0.0, 0.0), z[:, 1:] - reached),
        (Block(moving, 1, 0.0, 0.0, 0.0), held[:, 1:] - kappa),
        (Block(first, n, 0.0, 0.0, 0.0, input=True), z[:, 0] - ca.DM(states[0])),
        (Block(first, 1, 0.0, 0.0, 0.0, input=True), held[:, 0] - kappa_before),
        (Block(moving, 1, 0.0, -rate, rate, input=True), change),
        (Block(planned, 1, 0.0, 0.0, 0.0, input=True), aux_along),
    ]
    if starts.size:
        along, offset = project.map(starts.size)(ca.reshape(feet, 1, -1), ca.reshape(placed[2:, :], 2, -1))
        left, right = reaches[0]
        offset = ca.reshape(offset, 2, -1)  # of left edges, of right edges
        clearance = ca.reshape(ca.vertcat(left - offset[0, :], offset[1, :] - right), starts.shape[1], stages)
        margin = ca.DM(settings.clearance + points["margin"][ahead]).T
        rows += [
            (Block(planned, starts.shape[1], 0.0, 0.0, 0.0, input=True), along),
            (Block(planned, starts.shape[1], 0.0, 0.0, np.inf, input=True), clearance - ca.repmat(margin, starts.shape[1], 1)),
        ]
    blocks = [block for block, _ in rows]
    row_order = by_stage(blocks)
    program = {"x": x, "f": cost, "g": ca.vertcat(*(ca.vec(value) for _, value in rows))[row_order.tolist()]}
    x0 = values_of(variables, lambda block: block.start)[order]
    lbx, lbg = (values_of(some, lambda block: block.low)[at] for some, at in ((variables, order), (blocks, row_order)))
    ubx, ubg = (values_of(some, lambda block: block.high)[at] for some, at in ((variables, order), (blocks, row_order)))
    options: dict[str, object] = {"print_time": False, "record_time": True}
    if method == "fatrop":
        options |= {
            "structure_detection": "manual", "N": stages, "nx": [n + 1] * (stages + 1), "equality": (lbg == ubg).tolist(),
            "nu": counts(variables, stages).tolist(), "ng": counts(blocks, stages).tolist(),
            "fatrop.print_level": 0, "fatrop.tolerance": tolerance,
        }  # fmt: skip
    else:
        options |= {"ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": tolerance}
    solver = ca.nlpsol("planning", method, program, options)
    bounds = {"x0": x0, "lbx": lbx, "ubx": ubx, "lbg": lbg, "ubg": ubg}
    return ExactNlp(solver, {name: ca.DM(value) for name, value in bounds.items()}, np.argsort(order), n, stages)


def deepest_cut(vehicle: Vehicle, stations: Stations, z: FloatArray) -> float:
    """Return by how much a plan (stages + 1, n) breaks its limits and their margin at stations, anywhere along the bodies [m].

    The exact program looks at the sampled points of the edges alone; this looks everywhere.
    """
    if stations.street is None:
        return 0.0
    at = stations.points[1 : len(z)]
    poses = place_many(vehicle.table(), evaluate_many(stations.path, at["s"]), z[1:])
    gaps = look(stations.street, vehicle.table(), axles_behind(vehicle), at["s"], poses)["gap"]
    return max(0.0, float(np.max(at["margin"] - np.min(gaps, axis=(1, 2, 3)))))


def _reaches(road: Road) -> list[FloatArray]:
    """Return the offsets of the left and the right kerb [m], signed; nothing on a road without limits."""
    if road.limits is None:
        return []
    rows = road.limits.table(road.limits.s)
    if road.drawn is not None or np.any(np.ptp(rows, axis=1) > 0.0) or road.limits.two_regions:
        raise NotImplementedError
    return [rows[:2, 0]]


def road_spline(path: ReferencePath, first: float, last: float) -> BSpline:
    """Return the road between two arclengths as a B-spline of degree 5 with threefold knots, which holds it without loss.

    Raises:
        ArithmeticError: it does not.

    """
    begin = max(0, int((first - path.s_first) / path.spacing))
    end = min(len(path.coefficients), int(np.ceil((last - path.s_first) / path.spacing)))
    breaks = path.s_first + path.spacing * np.arange(begin, end + 1)
    knots = np.concatenate([np.repeat(breaks[0], 6), np.repeat(breaks[1:-1], 3), np.repeat(breaks[-1], 6)])
    sites = np.array([np.mean(knots[i + 1 : i + 1 + _DEGREE]) for i in range(len(knots) - _DEGREE - 1)])
    sites = np.clip(sites, breaks[0], breaks[-1])  # the mean of equal numbers may differ from them in the last bit
    xy = evaluate_many(path, sites)[:2].T
    spline = make_interp_spline(sites, xy, k=_DEGREE, t=knots)
    probes = np.linspace(breaks[0], breaks[-1], 7 * len(breaks))
    error = np.max(np.abs(spline(probes) - evaluate_many(path, probes)[:2].T))
    if not error < _SAME_M:
        msg = f"the road's B-spline is off by {error:.1e} m"
        raise ArithmeticError(msg)
    return spline


def _projection(path: ReferencePath, horizon: float) -> ca.Function:
    """Return (s, point) -> (distance along the road's tangent at s, offset to the left)."""
    spline = road_spline(path, -_REACH_M, horizon + _REACH_M)
    s, point = ca.MX.sym("s"), ca.MX.sym("point", 2)
    on_road, tangent = (_casadi_spline(curve, s) for curve in (spline, spline.derivative()))
    away, unit = point - on_road, tangent / ca.norm_2(tangent)
    return ca.Function("project", [s, point], [ca.dot(away, unit), unit[0] * away[1] - unit[1] * away[0]])


def _casadi_spline(spline: BSpline, s: ca.MX) -> ca.MX:
    coefficients = spline.c[: len(spline.t) - spline.k - 1]  # SciPy pads a derivative's with zeros
    return ca.bspline(s, ca.DM(coefficients.ravel()), [spline.t.tolist()], [spline.k], 2, {"lookup_mode": ["binary"]})


def advance(vehicle: Vehicle, step: float) -> ca.Function:
    """Return (z, kappa, curvature here, curvature between) -> the state one station ahead by the explicit midpoint rule."""
    z, kappa, k, between = ca.SX.sym("z", vehicle.states), ca.SX.sym("kappa"), ca.SX.sym("k"), ca.SX.sym("between")
    middle = z + 0.5 * step * _derivative(vehicle, z, kappa, k)
    return ca.Function("advance", [z, kappa, k, between], [z + step * _derivative(vehicle, middle, kappa, between)])


def _derivative(vehicle: Vehicle, z: ca.SX, kappa: ca.SX, k: ca.SX) -> ca.SX:
    """Return dz/ds from every axle's own velocity: its size, and its angle off the body that the wheels give it."""
    lead = vehicle.lead
    angle = _wheels(lead, ca.atan(lead.wheelbase * kappa))
    travelled = (1 - z[0] * k) / ca.cos(z[1] + angle)  # metres that the lead rear axle rolls per metre of road
    turn = ca.cos(angle) * kappa - ca.sin(angle) / lead.wheelbase
    rates = [travelled * ca.sin(z[1] + angle), travelled * turn - k]
    speed = ca.SX(1)
    for i, (ahead, unit) in enumerate(zip(vehicle.units, vehicle.units[1:], strict=False)):
        beta = z[2 + i]
        along = speed * ca.cos(angle + beta) + ahead.hitch_offset * turn * ca.sin(beta)  # of the coupling, in the axes of the body behind
        across = speed * ca.sin(angle + beta) - ahead.hitch_offset * turn * ca.cos(beta)
        angle = _wheels(unit, beta)
        behind = (across - along * ca.tan(angle)) / unit.wheelbase
        rates.append(travelled * (turn - behind))
        speed, turn = along / ca.cos(angle), behind
    return ca.vertcat(*rates)


def _wheels(unit: Unit, angle: ca.SX) -> ca.SX:
    """Return how far a unit's axle is turned off its body by the ``angle`` that steers it [rad]."""
    return -ca.fmin(ca.fmax(unit.steering_ratio * angle, -unit.max_steering_angle), unit.max_steering_angle)


def _placement(vehicle: Vehicle, auxiliary: int, points: Records) -> ca.Function:
    """Return (z, x, y, cos, sin of the road) -> x, y of the auxiliary axle, then of all points as unit, point, edge."""
    z, road = ca.SX.sym("z", vehicle.states), ca.SX.sym("road", 4)
    heading = ca.atan2(road[3], road[2]) + z[1]
    axle = ca.vertcat(road[0] - z[0] * road[3], road[1] + z[0] * road[2])
    bodies: list[ca.SX] = []
    for i, unit in enumerate(vehicle.units):
        if i > 0:
            hitch = axle - vehicle.units[i - 1].hitch_offset * ca.vertcat(ca.cos(heading), ca.sin(heading))
            heading -= z[1 + i]
            axle = hitch - unit.wheelbase * ca.vertcat(ca.cos(heading), ca.sin(heading))
        along, left = ca.vertcat(ca.cos(heading), ca.sin(heading)), ca.vertcat(-ca.sin(heading), ca.cos(heading))
        if i == auxiliary:
            aux = axle + (vehicle.lead.wheelbase if i == 0 else 0.0) * along
        bodies += [axle + ahead * along + side * 0.5 * unit.width * left for ahead in points["ahead"][i] for side in (1, -1)]
    return ca.Function("place", [z, road], [ca.vertcat(aux, *bodies)])
