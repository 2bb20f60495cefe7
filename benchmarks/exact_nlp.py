"""The exact nonlinear program of one planning step, for CasADi and IPOPT: an oracle that shares no linearisation with hdvplan.

Multiple shooting with the planner's own discretisation. Bodies are held at the sampled points of their edges; the planner also
looks between them, which matters where a limit has a corner or where the road bends around an edge. The feet of the auxiliary
axle and of every body point are variables of their own, each held on the road by a projection equation; the road is the same
piecewise quintic, written as a B-spline without loss.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import casadi as ca
import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from hdvplan.jit import FloatArray, Records
from hdvplan.planning.discretisation import Discretisation
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.centring import Centring
from hdvplan.road.path import ReferencePath, evaluate_many
from hdvplan.vehicle.body import axles_behind, edge_points
from hdvplan.vehicle.model import Unit, Vehicle

_DEGREE = 5
_SAME_M = 1e-9  # the B-spline must be the road to within this
_REACH_M = 25.0  # road beyond the horizon's ends on which body points may have their feet
_EVALUATIONS = ("nlp_f", "nlp_g", "nlp_grad_f", "nlp_jac_g", "nlp_hess_l")  # as CasADi's statistics name them
_SUCCESS = ("Solve_Succeeded", "Solved_To_Acceptable_Level")


@dataclass(frozen=True)
class Optimum:
    """What IPOPT found, and the time of its call alone (the program was built and differentiated before)."""

    z: FloatArray  # (N+1, n)
    kappa: FloatArray  # (N,)
    solved: bool
    iterations: int
    seconds: float
    evaluating: float  # of these, in CasADi's functions and derivatives; the rest is IPOPT with its linear solver


@dataclass(frozen=True)
class ExactNlp:
    """A program ready to be solved from its cold start."""

    solver: ca.Function
    bounds: dict[str, ca.DM]
    z_start: FloatArray
    stages: int

    def solve(self) -> Optimum:
        """Solve from the stationary geometry of the road."""
        began = perf_counter()
        found = self.solver(**self.bounds)
        seconds = perf_counter() - began
        n, x = len(self.z_start), np.array(found["x"]).ravel()
        z = np.vstack([self.z_start, x[: n * self.stages].reshape(self.stages, n)])
        stats = self.solver.stats()
        kappa = x[n * self.stages : (n + 1) * self.stages]
        evaluating = sum(float(stats[f"t_wall_{name}"]) for name in _EVALUATIONS)
        return Optimum(z, kappa, stats["return_status"] in _SUCCESS, int(stats["iter_count"]), seconds, evaluating)


def exact_nlp(
    vehicle: Vehicle, stations: Stations, goal: Goal, settings: PlannerSettings, kappa_before: float, *, tolerance: float
) -> ExactNlp:
    """Return the program of a drive's first plan; it starts in the stationary geometry at station 0.

    Raises:
        NotImplementedError: another rule than the midpoint's, axles that the plan steers, or another goal than centring.

    """
    (term,) = goal.terms
    if settings.discretisation is not Discretisation.MIDPOINT or vehicle.active or not isinstance(term, Centring):
        raise NotImplementedError
    residual = term.residual
    stages, n = settings.stages, vehicle.states
    ahead, geometry = slice(1, stages + 1), stations.centring
    states = np.column_stack([geometry.e_y, geometry.e_psi, geometry.beta])[: stages + 1]
    z_start = states[0]
    project = _projection(stations.path, float(stations.s[stages]))
    z, kappa = ca.MX.sym("z", n, stages), ca.MX.sym("kappa", 1, stages)
    aux_feet = ca.MX.sym("aux_feet", 1, stages)
    points = stations.points
    k, between = points["curvature"][:stages], points["curvature_between"][:stages]
    before = ca.horzcat(ca.DM(z_start), z[:, :-1])
    dynamics = _advance(vehicle, settings.step).map(stages)(before, kappa, ca.DM(k).T, ca.DM(between).T) - z
    axle = residual.axle % len(vehicle.units)
    placed = _placement(vehicle, axle).map(stages)(z, ca.DM(np.stack([points[name][ahead] for name in ("x", "y", "cos", "sin")])))
    aux_along, aux_offset = project.map(stages)(aux_feet, placed[:2, :])
    centred = ca.DM(residual.lead[ahead]).T * z[0, :] + ca.DM(residual.aux[ahead]).T * aux_offset - ca.DM(residual.target[ahead]).T
    change = kappa - ca.horzcat(ca.DM(kappa_before), kappa[:, :-1])
    cost = settings.smoothness * ca.sumsqr(change) + ca.sumsqr(centred)
    limit, rate = vehicle.max_curvature, vehicle.max_curvature_rate * settings.step
    behind = axles_behind(vehicle)
    s = stations.s[ahead]
    parts = [
        # variable, its start, its bound; then constraint, lower and upper bound
        (ca.vec(z), states[1:].ravel(), np.inf),
        (ca.vec(kappa), geometry.kappa[:stages], limit),
        (ca.vec(aux_feet), s + (vehicle.lead.wheelbase if axle == 0 else -behind[axle]), np.inf),
    ]
    rows = [(ca.vec(dynamics), 0.0, 0.0), (ca.vec(aux_along), 0.0, 0.0), (ca.vec(change), -rate, rate)]
    if stations.limits.values.size:
        edges = edge_points(vehicle)
        starts = (s[:, None, None] + edges["ahead"][None] - behind[None, :, None]).reshape(stages, -1)
        starts = np.repeat(starts, 2, axis=1)  # left edge, right edge
        feet = ca.MX.sym("feet", starts.shape[1], stages)
        along, offset = project.map(starts.size)(ca.reshape(feet, 1, -1), ca.reshape(placed[2:, :], 2, -1))
        clearance = _clearance(stations, edges).map(stages)(feet, ca.reshape(offset, starts.shape[1], stages))
        parts.append((ca.vec(feet), starts.ravel(), np.inf))
        margin = np.repeat(settings.clearance + points["margin"][ahead], starts.shape[1])
        rows += [(ca.vec(along), 0.0, 0.0), (ca.vec(clearance) - ca.DM(margin), 0.0, np.inf)]
    program = {"x": ca.vertcat(*(part[0] for part in parts)), "f": cost, "g": ca.vertcat(*(row[0] for row in rows))}
    options = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "record_time": True, "ipopt.tol": tolerance}
    bounds = {
        "x0": np.concatenate([part[1] for part in parts]),
        "lbx": np.concatenate([np.full(len(part[1]), -part[2]) for part in parts]),
        "ubx": np.concatenate([np.full(len(part[1]), part[2]) for part in parts]),
        "lbg": np.concatenate([np.full(row[0].numel(), row[1]) for row in rows]),
        "ubg": np.concatenate([np.full(row[0].numel(), row[2]) for row in rows]),
    }
    solver = ca.nlpsol("planning", "ipopt", program, options)
    return ExactNlp(solver, {name: ca.DM(value) for name, value in bounds.items()}, z_start, stages)


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
    xy = evaluate_many(path.curve, sites)[:2].T
    spline = make_interp_spline(sites, xy, k=_DEGREE, t=knots)
    probes = np.linspace(breaks[0], breaks[-1], 7 * len(breaks))
    error = np.max(np.abs(spline(probes) - evaluate_many(path.curve, probes)[:2].T))
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


def _clearance(stations: Stations, points: Records) -> ca.Function:
    """Return (feet, offsets) of one stage's points -> their clearance to the limits [m]; points as unit, point, edge."""
    table = stations.limits
    grid = (table.s_first + table.spacing * np.arange(table.values.shape[1])).tolist()
    limits = [ca.interpolant(f"limit{row}", "linear", [grid], values.tolist()) for row, values in enumerate(table.values)]
    count = 2 * points.size
    feet, offsets = ca.MX.sym("feet", count), ca.MX.sym("offsets", count)
    overhang = np.repeat(points["overhang"].ravel(), 2)
    gaps = [(1 - 2 * (i % 2)) * (limits[i % 2 + 2 * overhang[i]](feet[i]) - offsets[i]) for i in range(count)]
    return ca.Function("clearance", [feet, offsets], [ca.vertcat(*gaps)])


def _advance(vehicle: Vehicle, step: float) -> ca.Function:
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


def _placement(vehicle: Vehicle, auxiliary: int) -> ca.Function:
    """Return (z, x, y, cos, sin of the road) -> x, y of the auxiliary axle, then of all points as unit, point, edge."""
    z, road = ca.SX.sym("z", vehicle.states), ca.SX.sym("road", 4)
    heading = ca.atan2(road[3], road[2]) + z[1]
    axle = ca.vertcat(road[0] - z[0] * road[3], road[1] + z[0] * road[2])
    points, bodies = edge_points(vehicle), []
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
