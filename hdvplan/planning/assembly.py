"""The program of a drive: which columns and rows it has, and its terms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hdvplan import core
from hdvplan.planning.objectives import Goal
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.limits import limits_of
from hdvplan.planning.terms.steering import Dynamics, Steering
from hdvplan.planning.terms.term import Columns, Motion, Needs, Part, Scene, Term, owned_by
from hdvplan.qp.program import StageQp, StageShape
from hdvplan.vehicle.model import Vehicle


def terms_of(stations: Stations, goal: Goal, settings: PlannerSettings) -> tuple[Term, ...]:
    """Return all terms of a drive's programs, in the order in which they are linearised: the dynamics clear what others add to."""
    limits = limits_of(stations, settings)
    return (Dynamics(), Steering(), *goal.terms, *((limits,) if limits else ()))


def needs_of(term: Term, vehicle: Vehicle) -> Needs:
    """Return what a term needs.

    Raises:
        OptionError: somebody else's term raises, or returns something else.

    """
    with owned_by(term):
        need: object = term.needs(vehicle)
        if not isinstance(need, Needs):
            msg = f"needs returned something of type {type(need).__name__}, not Needs"
            raise TypeError(msg)
        return need


def qp_shape(vehicle: Vehicle, stages: int, terms: Sequence[Term]) -> StageShape:
    """Return the sizes and zero pattern of a vehicle's QP: states (dz, d kappa_{i-1}), one input, and what the terms need.

    Every axle that the plan steers has one input more, the change of its wheels' angle, which is a bounded state. States and inputs of
    the terms stand behind the vehicle's own.
    """
    needs = [needs_of(term, vehicle) for term in terms]
    n, rigid, more = vehicle.states, vehicle.rigid_states, sum(need.states for need in needs)
    size = n + 1 + more
    a, q = np.zeros((size, size), bool), np.zeros((size, size), bool)
    a[:rigid, :rigid] = np.tril(np.ones((rigid, rigid), bool))  # an articulation angle depends on itself and what is ahead of it
    a[0, 1] = True
    a[range(n, size), range(n, size)] = True
    a[:rigid, n] = q[:rigid, :rigid] = True
    wheels = np.arange(rigid, n)
    for unit, wheel in zip(vehicle.active, wheels, strict=True):
        a[1 + unit : rigid, wheel] = a[wheel, wheel] = q[wheel, wheel] = True
    g = np.ones(size, bool)
    inputs, rows = 1 + len(wheels) + sum(need.inputs for need in needs), sum(need.rows for need in needs)
    return StageShape(stages, size, inputs, rows, (n, *map(int, wheels)), a_pattern=a, q_pattern=q, g_pattern=g)


def assemble(
    vehicle: Vehicle, stations: Stations, goal: Goal, settings: PlannerSettings, capacity: int | None = None
) -> tuple[Scene, tuple[Part, ...]]:
    """Lay out the program of a drive; return its memory and the terms in their places.

    ``capacity`` is for how many stages there is memory: by default for those of one horizon.
    """
    terms = terms_of(stations, goal, settings)
    most = (settings.stages + 1 if capacity is None else capacity) - 1
    qp = StageQp.empty(qp_shape(vehicle, most, terms))
    scene = Scene(vehicle, stations, settings, vehicle.table(), qp, Motion.empty(vehicle, most))
    parts, columns = [], Columns(vehicle.states + 1, 1 + len(vehicle.active), 0)
    for term in terms:
        need = needs_of(term, vehicle)
        with owned_by(term):
            part = term.part(scene, columns)
            for array in part.memory:
                core.address(array, shape=(scene.capacity, *array.shape[1:]))
            parts.append(part)
        columns = Columns(columns.state + need.states, columns.input + need.inputs, columns.row + need.rows)
    return scene, tuple(parts)
