"""Roads that travel with hdvplan: real centre lines, small made-up places, and the parametric roads of the papers (spec, section 6)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate, pairwise
from math import inf, isfinite, pi
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from hdvplan.errors import OptionError

if TYPE_CHECKING:
    from hdvplan.road.road import Road

NOTICE = "© OpenStreetMap contributors, ODbL 1.0"
_PACKAGE = Path(__file__).parents[1]
Profile = tuple[tuple[float, ...], tuple[float, ...]]  # arclengths [m] and curvatures there [1/m]; no arrays: lists of roads load no NumPy

_LEAD_M = 50.0  # straight before and after: the roundabout's of [GEO] fig. 8, taken for all
_ART_HORIZON_M = 134.2  # [ART] table 2
_ART_LEAD_IN_M = 40.0


def shipped(kind: str = "osm") -> dict[str, Path]:
    """Return the files of the shipped places by name, sorted: ``osm`` roads, made-up ``examples``, ``opendrive`` maps, ``networks``."""
    installed = _PACKAGE / "_roads" / kind
    directory = installed if installed.is_dir() else _PACKAGE.parent / "roads" / kind
    ending = {"networks": ".osm.pbf", "opendrive": ".xodr"}.get(kind, ".geojson")
    return {path.name.removesuffix(ending): path for path in sorted(directory.glob(f"*{ending}"))}


def shipped_roads() -> dict[str, Path]:
    """Return the files of all places that are driven by their name."""
    return {**shipped(), **shipped("examples"), **shipped("opendrive")}


def turn_profile(curvature: float, ramp: float, constant: float, lead_in: float = _LEAD_M, lead_out: float = _LEAD_M) -> Profile:
    """Return straight, ramp, constant ``curvature`` [1/m], ramp, straight; lengths [m].

    Raises:
        OptionError: a length is negative or the ramp is zero (curvature must be continuous).

    """
    return _profile([lead_in, ramp, constant, ramp, lead_out], [0.0, 0.0, curvature, curvature, 0.0, 0.0])


def uturn_profile(
    curvature: float = 0.060, ramp: float = 20.9, *, angle: float = pi, lead_in: float = _LEAD_M, lead_out: float = _LEAD_M
) -> Profile:
    """Return a turn by ``angle`` [rad] with largest ``curvature`` [1/m]; the defaults are [GEO] fig. 7.

    Raises:
        OptionError: the ramps [m] alone turn by more than ``angle``, or a length is negative.

    """
    return turn_profile(curvature, ramp, angle / abs(curvature) - ramp, lead_in, lead_out)


def sturn_profile(
    curvature: float = 0.06, sharpness: float = 0.01, *, constant: float = 10.0, lead_in: float = _LEAD_M, lead_out: float = _LEAD_M
) -> Profile:
    """Return a left and a right turn of largest ``curvature`` [1/m], changing by ``sharpness`` [1/m^2], after [GEO] fig. 11.

    How long [GEO] keeps the largest curvature is not published; ``constant`` [m] is ours.

    Raises:
        OptionError: a length or the sharpness is not positive.

    """
    if not sharpness > 0.0:
        msg = f"the sharpness must be positive, not {sharpness:g} 1/m^2"
        raise OptionError(msg)
    ramp = abs(curvature) / sharpness
    lengths = [lead_in, ramp, constant, 2.0 * ramp, constant, ramp, lead_out]
    return _profile(lengths, [0.0, 0.0, curvature, curvature, -curvature, -curvature, 0.0, 0.0])


def _profile(lengths: list[float], curvature: list[float]) -> Profile:
    """Return the profile of pieces of the given lengths; pieces of constant curvature may have length zero."""
    changes = [before != after for before, after in pairwise(curvature)]
    steps = [length <= 0.0 and changed for length, changed in zip(lengths, changes, strict=True)]
    if any(steps) or not all(0.0 <= length < inf for length in lengths) or not all(map(isfinite, curvature)):
        msg = f"a road cannot be made of pieces of {', '.join(f'{piece:g}' for piece in lengths)} m"
        raise OptionError(msg, hint="lengths must not be negative, and curvature needs a ramp to change on")
    s = accumulate(lengths, initial=0.0)
    kept = [place for place, length in zip(zip(s, curvature, strict=True), [inf, *lengths], strict=True) if length > 0.0]
    return tuple(at for at, _ in kept), tuple(kappa for _, kappa in kept)


def uturn_articulated_profile(ramp: float = 1.0) -> Profile:
    """Return the turn of [ART] table 2, with ramps of a length that is not published [m]."""
    curvature = 0.065
    turning = pi / curvature + ramp
    return uturn_profile(curvature, ramp, lead_in=_ART_LEAD_IN_M, lead_out=_ART_HORIZON_M - _ART_LEAD_IN_M - turning)


@dataclass(frozen=True, eq=False)
class Scenario:
    """A published road, made when it is called; its profile is there at once."""

    name: str
    profile: Profile
    half_width: float | None = None  # of its limits [m]

    def __call__(self) -> Road:
        """Return the road."""
        from hdvplan.road.path import from_curvature  # noqa: PLC0415 - slow to load
        from hdvplan.road.road import Road  # noqa: PLC0415 - as above

        road = Road(self.name, from_curvature(*self.profile))
        return road if self.half_width is None else road.with_limits(self.half_width, self.half_width)


uturn = Scenario("uturn", uturn_profile(), 3.0)  # the bus's of [GEO] fig. 7
uturn_articulated = Scenario("uturn_articulated", uturn_articulated_profile())  # of [ART] table 2: 134.2 m in all, no limits
roundabout = Scenario("roundabout", turn_profile(1.0 / 17.88, 5.5, 135.0), 3.56)  # of [GEO] figs. 8-10: radius 17.88 m, 135 m long
sturn = Scenario("sturn", sturn_profile())  # from the middle of [GEO] fig. 11's range; no limits are published

SCENARIOS: Mapping[str, Scenario] = MappingProxyType({road.name: road for road in (roundabout, sturn, uturn, uturn_articulated)})
