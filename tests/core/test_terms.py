"""What every term of a program owes the others: its own columns and rows and no more, sums, and updates that equal a fresh start."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import CentringTable
from hdvplan.planning import planner as planner_module
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import OBJECTIVES, Goal, axle_max, balanced, body_max, geometric
from hdvplan.planning.planner import Planner
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import Stations, stations_of
from hdvplan.planning.terms.balance import BalancePart, EnvelopeBalance
from hdvplan.planning.terms.centring import Centring, Reach, Residual
from hdvplan.planning.terms.limits import ROWS_PER_SIDE, Limits
from hdvplan.planning.terms.steering import Dynamics, Steering
from hdvplan.planning.terms.term import Columns, Horizon, Motion, Part, Scene, Term
from hdvplan.qp.program import StageQp, StageShape, row_dtype
from hdvplan.road.limits import Limits as RoadLimits
from hdvplan.road.road import Road
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import winding
from tests.core.scenes import SAME, assert_same_rows, extended, horizon_at, linearised, move, moved_of, part_of

STEP, STAGES, FIRST = 0.5, 60, 30
SETTINGS = PlannerSettings(horizon=STAGES * STEP, step=STEP)
ACTIVE, TRAILER = load_vehicle("semitrailer-active"), load_vehicle("tractor-trailer")
ROAD = Road("winding", winding())


def prepared(vehicle: Vehicle, half_width: float = 2.0) -> Stations:
    """Return stations on a road with a narrow strip for wheels and some more for overhangs."""
    ends, wheels = np.array([0.0, ROAD.path.length]), np.full(2, half_width)
    limits = RoadLimits(ends, wheels, -wheels, wheels + 0.3, -wheels - 0.3)
    return stations_of(replace(ROAD, limits=limits), vehicle, CentringTable.of(vehicle), step=STEP, horizon=SETTINGS.horizon)


def residual(stations: Stations) -> Residual:
    return Residual(*np.random.default_rng(3).uniform(0.5, 2.0, (3, len(stations.s))))


TERMS: dict[str, Callable[[Stations], Term]] = {  # one of each kind
    "dynamics": lambda _: Dynamics(),
    "centring": lambda stations: Centring(residual(stations)),
    "balance": lambda stations: EnvelopeBalance(residual(stations), stations.bias),
    "reach of bodies": lambda _: Reach(bodies=True),
    "reach of axles": lambda _: Reach(bodies=False),
    "steering": lambda _: Steering(),
    "limits": lambda _: Limits(ROWS_PER_SIDE),
    "limits and overhangs": lambda _: Limits(2 * ROWS_PER_SIDE),
}
each_term = pytest.mark.parametrize("name", TERMS)


def random_motion(vehicle: Vehicle, seed: int) -> tuple[FloatArray, FloatArray]:
    random = np.random.default_rng(seed)
    scale = np.array([0.5, 0.1, 0.15, 0.1])[: vehicle.states]
    return scale * random.uniform(-1.0, 1.0, (STAGES + 1, vehicle.states)), random.uniform(-0.05, 0.05, STAGES)


def scene_of(shape: StageShape, vehicle: Vehicle = ACTIVE, seed: int = 1) -> Scene:
    """Return the memory of a program full of numbers that nobody wrote, at a random motion."""
    scene = Scene(vehicle, prepared(vehicle), SETTINGS, vehicle.table(), StageQp.empty(shape), Motion.empty(vehicle, STAGES))
    scene.qp.buffer[:] = np.random.default_rng(7).uniform(1.0, 2.0, scene.qp.buffer.size)
    move(scene, *random_motion(vehicle, seed))
    extended([Dynamics().part(scene, Columns(0, 0, 0))], horizon_at(scene, FIRST))  # terms find poses, and cleared costs
    scene.qp.stages["Q"] = scene.qp.stages["q"] = 0.0
    return scene


@each_term
def test_a_term_writes_the_columns_and_rows_that_it_declares_and_no_others(name: str) -> None:
    term = TERMS[name](prepared(ACTIVE))
    need, n, m = term.needs(ACTIVE), ACTIVE.states + 1, 1 + len(ACTIVE.active)
    # two states, inputs and rows of others, one to each side; and as many states and inputs for all terms
    scene = scene_of(StageShape(STAGES, n + 3, m + 3, 2 + need.rows, (n - 1, n - 2)))
    assert max(need.states, need.inputs) <= 1
    columns = Columns(n + 1, m + 1, 1)
    untouched = scene.qp.buffer.copy()
    part = term.part(scene, columns)
    extended([part], horizon_at(scene, FIRST))
    linearised([part], horizon_at(scene, FIRST))
    now, then = scene.qp, StageQp(scene.qp.shape, untouched)
    own_states = [*range(n), *range(columns.state, columns.state + need.states)]
    own_inputs = [*range(m), *range(columns.input, columns.input + need.inputs)]
    states, inputs = (np.isin(np.arange(count), own) for count, own in ((now.shape.states, own_states), (now.shape.inputs, own_inputs)))
    for array, owners in (("A", (states, states)), ("B", (states, inputs)), ("c", (states,)), ("Q", (states, states)), ("q", (states,)),
                          ("R", (inputs, inputs)), ("r", (inputs,)), ("u_low", (inputs,)), ("u_high", (inputs,))):  # fmt: skip
        changed = np.any(getattr(now, array) != getattr(then, array), axis=0)
        mine = owners[0] if len(owners) == 1 else np.outer(*owners)
        if name != "dynamics" or array not in {"Q", "q"}:  # which it clears for all
            assert not np.any(changed & ~mine), array
    own_rows = slice(columns.row, columns.row + need.rows)
    others = np.ones(now.shape.rows, bool)
    others[own_rows] = False
    for column in row_dtype(now.shape.states).names or ():
        assert np.array_equal(now.rows[column][:, others], then.rows[column][:, others])
    assert np.all(now.rows["h"][1:, own_rows] != then.rows["h"][1:, own_rows])
    assert np.all(now.rows["linear"][:, own_rows] != then.rows["linear"][:, own_rows])
    for state in range(columns.state, columns.state + need.states):  # what is declared is used
        assert np.any(now.A[:, state] != then.A[:, state])
    for own in range(columns.input, columns.input + need.inputs):
        assert np.any(now.B[:, :, own] != then.B[:, :, own])
        assert np.all(now.R[:, own, own] > 0.0)


def goal_of(*names: str) -> Callable[[Stations], Goal]:
    return lambda stations: Goal(tuple(TERMS[name](stations) for name in names))


def program(vehicle: Vehicle, goal: Callable[[Stations], Goal], *, limited: bool = True) -> tuple[Scene, tuple[Part, ...], Horizon]:
    """Return an assembled program, linearised at a random motion."""
    stations = prepared(vehicle)
    stations = stations if limited else replace(stations, street=None)
    scene, parts = assemble(vehicle, stations, goal(stations), SETTINGS)
    move(scene, *random_motion(vehicle, 1))
    horizon = horizon_at(scene, FIRST)
    extended(parts, horizon)
    return scene, parts, horizon


@pytest.mark.parametrize("vehicle", [TRAILER, ACTIVE], ids=lambda v: v.name)
def test_a_program_is_the_sum_of_its_terms(vehicle: Vehicle) -> None:
    names = ("centring", "balance", "reach of axles")
    whole, parts, horizon = program(vehicle, goal_of(*names))
    bare, bare_parts, _ = program(vehicle, goal_of(), limited=False)
    n, size = vehicle.states + 1, whole.qp.shape.states
    total_Q, total_q, price = np.zeros_like(whole.qp.Q), np.zeros_like(whole.qp.q), sum(part.price(horizon) for part in bare_parts)
    total_Q[:, :n, :n], total_q[:, :n] = bare.qp.Q, bare.qp.q
    row = 0
    for name in names:
        alone, alone_parts, _ = program(vehicle, goal_of(name), limited=False)
        own = alone.qp.shape.states
        total_Q[:, :own, :own] += alone.qp.Q
        total_q[:, :own] += alone.qp.q
        total_Q[:, :n, :n] -= bare.qp.Q
        total_q[:, :n] -= bare.qp.q
        rows = slice(row, row + alone.qp.shape.rows)
        assert np.array_equal(whole.qp.rows["h"][1:, rows], alone.qp.rows["h"][1:])
        assert np.array_equal(whole.qp.rows["g"][1:, rows, :own], alone.qp.rows["g"][1:])
        assert not np.any(whole.qp.rows["g"][1:, rows, own:])
        row, price = rows.stop, price + sum(part.price(horizon) for part in alone_parts) - sum(part.price(horizon) for part in bare_parts)
    limited, limited_parts, _ = program(vehicle, goal_of())
    assert np.array_equal(whole.qp.rows["h"][1:, row:], limited.qp.rows["h"][1:])
    assert np.array_equal(whole.qp.rows["g"][1:, row:, :n], limited.qp.rows["g"][1:])
    assert not np.any(whole.qp.rows["g"][1:, row:, n:])
    price += sum(part.price(horizon) for part in limited_parts) - sum(part.price(horizon) for part in bare_parts)
    assert size == n + 1
    assert np.allclose(whole.qp.Q[1:], total_Q[1:], rtol=1e-12, atol=1e-12)  # rounding, in another order of sums
    assert np.allclose(whole.qp.q[1:], total_q[1:], rtol=1e-12, atol=1e-12)
    assert sum(part.price(horizon) for part in parts) == pytest.approx(price, rel=1e-12)


def test_only_limits_say_that_a_motion_breaks_some() -> None:
    _, parts, horizon = program(TRAILER, goal_of("centring", "balance", "reach of axles"))
    linearised(parts, horizon)
    *others, limits = (part.violation for part in parts)
    assert not any(others)
    assert limits > 0.0  # of a random motion


def each_pair(objectives: Iterable[str]) -> pytest.MarkDecorator:
    """Return the mark of a test of a trailer that follows and of one whose axle the plan steers, with every objective."""
    pairs = [pytest.param(vehicle, name, id=f"{vehicle.name}-{name}") for vehicle in (TRAILER, ACTIVE) for name in objectives]
    return pytest.mark.parametrize(("vehicle", "objective"), pairs)


@each_pair(OBJECTIVES)
def test_every_value_of_an_assembled_program_lies_in_its_pattern(vehicle: Vehicle, objective: str) -> None:
    scene, _, _ = program(vehicle, lambda stations: OBJECTIVES[objective](stations, vehicle))
    shape = scene.qp.shape
    assert shape.a_pattern is not None
    assert shape.q_pattern is not None
    assert shape.g_pattern is not None
    assert not np.any(scene.qp.A[:, ~shape.a_pattern])
    assert not np.any(scene.qp.Q[1:, ~(shape.q_pattern | np.eye(shape.states, dtype=bool))])  # whose diagonal solvers always keep
    assert not np.any(scene.qp.G[:, :, ~shape.g_pattern])


@pytest.fixture(autouse=True)
def _one_horizon_of_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a planner's memory be its window."""
    monkeypatch.setattr(planner_module, "_HORIZONS", 1)


GOALS = {"geometric": geometric, "balanced": balanced, "body-max": body_max, "axle-max": axle_max}
each_goal = pytest.mark.parametrize("objective", GOALS)


def assert_same_program(one: StageQp, other: StageQp, stages: slice = slice(None)) -> None:
    """Compare what matters of two programs at some of the stages 1..N; the first state is given, so its cost does not."""
    for name in ("A", "B", "c", "R", "r", "u_low", "u_high", "linear", "quadratic", "x_low", "x_high"):
        assert np.allclose(getattr(one, name)[stages], getattr(other, name)[stages], rtol=0.0, atol=SAME), name
    for name in ("Q", "q"):
        mine, theirs = (getattr(qp, name)[1:][stages] for qp in (one, other))
        assert np.allclose(mine, theirs, rtol=SAME, atol=SAME), name


def driven(vehicle: Vehicle, objective: str, steps: int) -> tuple[Planner, Stations, Horizon]:
    """Return a planner after some steps of a drive whose limits bind, and the horizon of its last plan."""
    stations = prepared(vehicle, HALF_WIDTH[vehicle.name])
    planner = Planner(vehicle, stations, GOALS[objective](stations, vehicle), SETTINGS, RiccatiWorkspace)
    plan = planner.plan(FIRST, stations.centring.states[FIRST], float(stations.centring.kappa[FIRST]))
    for step in range(1, steps):
        plan = planner.plan(FIRST + 10 * step, plan.z[10], float(plan.kappa[9]))
    assert plan.usable
    return planner, stations, horizon_at(planner._scene, plan.first, before=plan.kappa_before, fixed=SETTINGS.executed)


HALF_WIDTH = {"tractor-trailer": 1.9, "semitrailer-active": 1.9}


def settle_feet(parts: tuple[Part, ...], horizon: Horizon) -> None:
    """Linearise until no foot moves any more."""
    for _ in range(3):
        linearised(parts, horizon)


def fresh_at(planner: Planner, stations: Stations, objective: str, horizon: Horizon) -> tuple[StageQp, tuple[Part, ...]]:
    """Return a program that knows nothing, at the planner's motion."""
    vehicle = planner._scene.vehicle
    scene, parts = assemble(vehicle, stations, GOALS[objective](stations, vehicle), SETTINGS)
    move(scene, planner._scene.motion.z, planner._scene.motion.kappa)
    extended(parts, horizon)
    return scene.qp, parts


@each_pair(GOALS)
def test_a_planner_s_program_is_that_of_a_fresh_one_at_its_motion(vehicle: Vehicle, objective: str) -> None:
    planner, stations, horizon = driven(vehicle, objective, steps=4)
    left = planner._scene.qp.Q[1:].copy()
    settle_feet(planner._parts, horizon)
    assert np.allclose(left, planner._scene.qp.Q[1:], rtol=1e-6, atol=1e-6)  # feet were found to 1e-7 m
    fresh, parts = fresh_at(planner, stations, objective, horizon)
    if objective == "balanced":  # what was driven is the one thing that no motion tells
        mine, theirs = (part_of(of, BalancePart) for of in (parts, planner._parts))
        mine.measured.driven[:], mine.data["since"] = theirs.measured.driven, theirs.data["since"]
        assert np.any(np.isfinite(theirs.measured.driven["reach"]))
    settle_feet(parts, horizon)
    assert_same_program(planner._scene.qp, fresh)
    assert_same_rows((planner._scene.qp, moved_of(planner._parts)), (fresh, moved_of(parts)))
    assert np.any(fresh.G)


@pytest.mark.parametrize("by", [1, 10, STAGES - 3])
@each_pair([name for name in GOALS if name != "balanced"])  # its places are measured over the whole plan
def test_a_shifted_program_is_that_of_a_fresh_one_at_its_motion(vehicle: Vehicle, objective: str, by: int) -> None:
    planner, stations, horizon = driven(vehicle, objective, steps=2)
    settle_feet(planner._parts, horizon)
    motion = planner._scene.motion
    z_start, before = motion.z[by] + 0.01, float(motion.kappa[by - 1])
    moved = horizon_at(planner._scene, horizon.first + by, before=before, fixed=SETTINGS.executed)
    planner._start[:] = z_start
    planner_module._begin(planner._address, moved.first, before)
    fresh, parts = fresh_at(planner, stations, objective, moved)
    new = slice(STAGES - by, STAGES)  # stages that the last plan did not reach, linearised once from feet as on a straight
    assert_same_program(planner._scene.qp, fresh, new)
    assert_same_rows((planner._scene.qp, moved_of(planner._parts)), (fresh, moved_of(parts)), new)
    settle_feet(parts, moved)
    kept = slice(0, STAGES - by)
    assert_same_program(planner._scene.qp, fresh, kept)
    assert_same_rows((planner._scene.qp, moved_of(planner._parts)), (fresh, moved_of(parts)), kept)
    assert np.array_equal(planner._scene.motion.z[0], z_start)


@each_goal
def test_extending_and_linearising_comes_to_what_extending_all_comes_to(objective: str) -> None:
    stations = prepared(TRAILER)
    programs = []
    for begin in (1, 2, 23, STAGES):
        scene, parts = assemble(TRAILER, stations, GOALS[objective](stations, TRAILER), SETTINGS)
        horizon = horizon_at(scene, FIRST)
        move(scene, *random_motion(TRAILER, 5))
        extended(parts, horizon)
        move(scene, *random_motion(TRAILER, 6))
        extended(parts, horizon, begin)
        settle_feet(parts, horizon)
        programs.append((scene.qp, moved_of(parts)))
    for other in programs[1:]:
        assert_same_program(programs[0][0], other[0])
        assert_same_rows(programs[0], other)


@pytest.mark.parametrize("half_width", [1.9, 3.0, 4.0])
def test_a_stage_that_is_not_live_has_rows_that_never_bind(half_width: float) -> None:
    stations = prepared(TRAILER, half_width)
    planner = Planner(TRAILER, stations, geometric(stations, TRAILER), SETTINGS, RiccatiWorkspace)
    z, kappa, counts = stations.centring.states[FIRST], float(stations.centring.kappa[FIRST]), np.zeros(2, int)
    for step in range(5):
        plan = planner.plan(FIRST + 10 * step, z, kappa)
        z, kappa = plan.z[10], float(plan.kappa[9])
        qp = planner._scene.qp
        live = qp.stages["live"][1:] > 0.0
        assert not np.any(qp.G[~live])
        assert np.all(qp.h[~live] > 0.0)
        assert np.all(np.any(qp.G[live], axis=(1, 2)))
        counts += [np.sum(live), np.sum(~live)]
    assert bool(counts[0] > 0) is (half_width < 4.0)
    assert bool(counts[1] > 10) is (half_width > 2.0)
