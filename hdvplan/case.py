"""A run as a value: everything that decides a plan, to keep, compare, send to another process and plan there."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields, is_dataclass
from functools import cached_property, partial
from hashlib import sha256
from typing import TYPE_CHECKING

import numpy as np
import shapely

from hdvplan.errors import RoadError
from hdvplan.planning.bias import NONE, Bias
from hdvplan.planning.settings import OBJECTIVE_NAMES, PlannerSettings, check_objective
from hdvplan.plugins import identity_of, is_reference, name_of
from hdvplan.road.road import Road
from hdvplan.settings import of_kind
from hdvplan.solvers.registry import DEFAULT, SolverMaker
from hdvplan.texts import meant_by
from hdvplan.vehicle.model import Vehicle

if TYPE_CHECKING:  # a case is made and compared without loading what plans
    from hdvplan.planning.objectives import Objective
    from hdvplan.solvers.registry import SolverClass

FORMAT = 2  # of the key: raise it when the same content gets another key
_DEFAULTS = PlannerSettings()
_DIGITS = 32  # of a digest in hexadecimal: 128 bits
_WIDEST_M = 100e3  # from the road's centre to a limit: further out projections end, and at last numbers
_NAMED = ("objective", "solver")  # fields that name what users may bring

Json = dict[str, object]


@dataclass(frozen=True, eq=False)
class Case:
    """One run: ``vehicle`` along ``road`` with an objective, a solver and settings, named as on the command line.

    ``bias`` is the wanted middle of the swept area, left positive. A case can be pickled, and gives the identical plan in another process
    with the same versions on the same kind of machine. Cases with equal keys are equal. Names are looked up when the case is planned, which
    may be on another machine; a misspelt objective is refused at once. Objective and solver may be Python objects (``objective_named``,
    ``solver_named``): the case can then be pickled if they can, and has a key if their source can be read.
    """

    road: Road
    vehicle: Vehicle
    objective: str | Objective = "geometric"
    solver: str | SolverClass = DEFAULT
    settings: PlannerSettings = _DEFAULTS
    bias: Bias = NONE

    def __post_init__(self) -> None:
        """Refuse what is of another kind, a misspelt objective, and limits of the road that lie where coordinates end.

        Raises:
            OptionError: there is such a field.
            RoadError: there is such a limit.

        """
        of_kind("road", self.road, Road, "hdvplan.load_road('uturn') returns one")
        of_kind("vehicle", self.vehicle, Vehicle, "hdvplan.load_vehicle('bus') returns one")
        of_kind("settings", self.settings, PlannerSettings, "hdvplan.PlannerSettings(horizon=50.0) is one")
        of_kind("bias", self.bias, Bias, "hdvplan.Bias.constant(0.3) is one")
        if isinstance(self.objective, str) and not is_reference(self.objective) and meant_by(self.objective, OBJECTIVE_NAMES):
            check_objective(self.objective)
        limits = self.road.limits
        if limits is None:
            return
        for side, values in (("left", limits.left_sweep), ("right", limits.right_sweep)):
            far = np.flatnonzero(np.abs(values) > _WIDEST_M)
            if far.size:
                s = float(limits.s[far[0]])
                msg = f"the {side} limit at s = {s:z.1f} m is {abs(values[far[0]]):g} m away; at most {_WIDEST_M / 1e3:g} km can be meant"
                raise RoadError(msg, s_m=s, hint="leave the limit out where there is none")

    def __repr__(self) -> str:
        """Return one line, for a notebook."""
        return f"<{type(self).__name__}: {self.vehicle.name} on {self.road!r}, {self.objective_name}, {self.solver_name}>"

    @cached_property
    def key(self) -> str:
        """A digest of everything that changes the plan, 32 hexadecimal digits; the same in every process and on every platform.

        Names and origins of road and vehicle are excluded: fields whose metadata has ``decides`` as False. A road's geometry is included
        to its last bit: a file that another platform smooths may differ there, a pickled case does not. For a solver or objective in a
        file, or as an object, the key includes its name and the content of its file; for a named one only the name, as for hdvplan's own:
        versions are not part of a key.

        Raises:
            OptionError: the source of such an object cannot be read, or does not tell what it does.

        """
        content = {field.name: getattr(self, field.name) for field in fields(self)}
        return content_digest(
            {"format": FORMAT, "case": {name: (_brought if name in _NAMED else _content)(one) for name, one in content.items()}}
        )

    @property
    def objective_name(self) -> str:
        """What records call the objective."""
        return name_of(self.objective)

    @property
    def solver_name(self) -> str:
        """What records call the solver."""
        return self.solver.name if isinstance(self.solver, SolverMaker) else name_of(self.solver)

    def __eq__(self, other: object) -> bool:
        """Tell whether both lead to the same plan."""
        return self.key == other.key if isinstance(other, Case) else NotImplemented

    def __hash__(self) -> int:
        """Return the key's hash."""
        return hash(self.key)

    def __getstate__(self) -> Json:
        """Return the fields alone: a key belongs to the version that computes it."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def described(self) -> Json:
        """Return the case for readers, ready for ``json.dumps``: road, vehicle with dimensions [m, rad], settings, names and key."""
        path, limited = self.road.path, self.road.street is not None
        road: Json = {"name": self.road.name, "length_m": path.length, "closed": path.closed, "limits": limited}
        return {
            "key": self.key,
            "road": road | {"regions": len(self.road.regions), "digest": self.road_digest},
            "vehicle": asdict(self.vehicle),
            "objective": self.objective_name,
            "solver": self.solver_name,
            "settings": settings_json(self.settings),
            "bias_m": _bias(self.bias),
        }

    def brief(self) -> Json:
        """Return the case as one of many: names, key, and of the settings and the bias what differs from the defaults."""
        usual = settings_json(_DEFAULTS)
        other = {name: value for name, value in settings_json(self.settings).items() if value != usual[name]}
        return {
            "key": self.key,
            "road": self.road.name,
            "road_digest": self.road_digest,
            "vehicle": self.vehicle.name,
            "objective": self.objective_name,
            "solver": self.solver_name,
            **({"settings": other} if other else {}),
            **({"bias_m": _bias(self.bias)} if np.any(self.bias.offset) else {}),
        }

    @property
    def road_digest(self) -> str:
        """A digest of what of the road changes a plan: geometry, limits and regions."""
        return content_digest(_content(self.road))


def _brought(chosen: object) -> object:
    """Return what of a solver or an objective changes a plan, for JSON; a name is itself."""
    match chosen:
        case SolverMaker(solver, None):
            return _brought(solver)
        case partial():
            return [_brought(chosen.func), _content(chosen.args), {name: _content(value) for name, value in chosen.keywords.items()}]
    if is_dataclass(chosen) and not isinstance(chosen, type):
        return [_brought(type(chosen)), {field.name: _content(getattr(chosen, field.name)) for field in fields(chosen)}]
    if not callable(chosen) and not isinstance(chosen, str):
        return _content(chosen)
    identity = identity_of(chosen)
    return identity[0] if len(identity) == 1 else list(identity)


def content_digest(content: object) -> str:
    """Return a digest of what ``json.dumps`` can write; the same in every process."""
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:_DIGITS]


def _content(value: object) -> object:
    match value:
        case None | str():
            return value
        case int() | float() | np.number():
            return float(value) + 0.0  # -0 is 0
        case np.ndarray():
            plain = np.asarray(value, dtype=np.float64) + 0.0
            return [*value.shape, sha256(plain.astype("<f8").tobytes()).hexdigest()]
        case shapely.Polygon():
            return [_content(np.asarray(ring.coords)) for ring in (value.exterior, *value.interiors)]
        case tuple():
            return [_content(one) for one in value]
    if is_dataclass(value):
        decisive = [field.name for field in fields(value) if field.metadata.get("decides", True)]
        return {name: _content(getattr(value, name)) for name in decisive}
    msg = f"a case cannot hold a {type(value).__name__}"
    raise TypeError(msg)


def settings_json(settings: PlannerSettings) -> Json:
    """Return settings for readers: numbers, words and lists of numbers."""
    told: Json = json.loads(json.dumps(asdict(settings)))
    return told


def _bias(bias: Bias) -> float | Json:
    if len(bias.s) == 1:
        return float(bias.offset[0])
    return {
        "points": len(bias.s),
        "least": float(bias.offset.min()),
        "most": float(bias.offset.max()),
        "digest": content_digest(_content(bias)),
    }
