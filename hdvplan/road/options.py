"""How a road file is read, as a user may say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import Annotated

from hdvplan.errors import OptionError, RoadError
from hdvplan.settings import METRES, Setting, check, fields_of

OF_POINTS = "corners", "corner_radius"  # options that say how points are read
REFERENCE_SLACK = 1.25  # a balanced lead axle turns wider than the road's centre, which may thus be tighter than its limit
_TIGHTEST = 0.5  # smoothing stations 1 m apart cannot represent a radius below 2 m [1/m]


class Corners(StrEnum):
    """How points are read: bends and corners told apart, all as corners, or all as samples of one curve."""

    AUTO = "auto"
    SHARP = "sharp"
    ROUND = "round"


class Role(StrEnum):
    """What a feature beside the line is."""

    OBSTACLE = "obstacle"
    SWEEPABLE = "sweepable"
    EDGE = "edge"


@dataclass(frozen=True)
class RoadOptions:
    """How to read a road file; each has a command-line option, but ``max_curvature``.

    ``max_curvature`` is the tightest reference curvature that the caller's vehicle can follow [1/m]. ``roles`` say what layers or
    features beside the line are, such as ``hoarding=obstacle``. ``road_ids`` are the roads of an OpenDRIVE file, or lanelets of a
    Lanelet2 map, to drive over, such as ``3,12,-5`` or ``("3", "12", "-5")``. Without ``corners`` and ``corner_radius`` the
    file's properties decide.

    Raises:
        OptionError: a value that no road can be read with.

    """

    smooth: Annotated[
        float | None,
        Setting("How far smoothing may move the road's line from the given points [m] [default: 5, or as it takes].", "M", above=0.0),
    ] = None
    crs: Annotated[str | None, Setting("Coordinate reference system of the road file.", "EPSG:N")] = None
    unit: Annotated[
        str | None,
        Setting(
            "Unit of a road file without a coordinate reference system (DXF; CSV with x,y or s,kappa) [default: what it says, or m].",
            choices=tuple(METRES),
        ),
    ] = None
    corners: Annotated[
        str | None,
        Setting(
            "How the line's points are read: bends and corners told apart, all as corners, or all on one curve [default: auto].",
            choices=tuple(Corners),
        ),
    ] = None
    corner_radius: Annotated[float | None, Setting("Radius of the kerbs inside corners of the line [m] [default: 0].", "M", least=0.0)] = (
        None
    )
    feature: Annotated[str | None, Setting("Which line of the road file, by its name or id.", "NAME", ("--name", "--id"))] = None
    layer: Annotated[str | None, Setting("Which layer, or sheet, of the road file.", "LAYER")] = None
    roles: Annotated[
        tuple[str, ...],
        Setting("What a layer or feature of the road file is: obstacle, sweepable or edge; may be repeated.", "NAME=ROLE", ("--role",)),
    ] = ()
    road_ids: Annotated[
        str | Sequence[str] | None,
        Setting(
            "Roads of an OpenDRIVE file or lanelets of a Lanelet2 map, in driving order; -A drives one from its end; gaps are filled.",
            "A,B,...",
        ),
    ] = None
    lane: Annotated[
        int | None,
        Setting(
            "Lane of the first OpenDRIVE road [default: the outermost that leads to the last]; 0: along the reference line of all roads.",
            "N",
        ),
    ] = None
    offset: Annotated[
        float,
        Setting("Drive this far to the left of the line, negative: right [m]; the file's edges stay, --half-width replaces them.", "M"),
    ] = 0.0
    reverse: Annotated[bool, Setting("Drive the line from its end to its start; applied before --offset.")] = False
    max_curvature: Annotated[float, Setting(above=0.0)] = 0.125

    def __post_init__(self) -> None:
        """Refuse values that no road can be read with."""
        check(self)
        if self.max_curvature > _TIGHTEST:
            msg = f"the largest reference curvature must be at most {_TIGHTEST:g} 1/m, not {self.max_curvature:g}"
            raise OptionError(msg)
        ids = self.road_ids
        one_by_one = isinstance(ids, tuple | list) and len(ids) > 0 and all(isinstance(one, str) for one in ids)
        if not (ids is None or isinstance(ids, str) or one_by_one):
            msg = f"road_ids must be ids of roads as text, not {ids!r}"
            raise OptionError(msg, hint='such as "3,12,-5" or ("3", "12", "-5")')

    @cached_property
    def named_roles(self) -> dict[str, Role]:
        """The roles of layers and features by their names.

        Raises:
            OptionError: a text is not of the form ``hoarding=obstacle``, or names no role.

        """
        roles: dict[str, Role] = {}
        for text in self.roles:
            name, _, role = text.rpartition("=")
            role = role.casefold()
            if not name or role not in list(Role):
                msg = f"--role {text!r} is not NAME=ROLE; a role is {', '.join(list(Role)[:-1])} or {list(Role)[-1]}"
                raise OptionError(msg, hint="NAME is a layer or a feature of the road file, such as --role hoarding=obstacle")
            roles[name] = Role(role)
        return roles

    def followed_by(self, max_curvature: float) -> RoadOptions:
        """Return the options for a vehicle that turns by at most ``max_curvature`` [1/m]."""
        return replace(self, max_curvature=min(REFERENCE_SLACK * max_curvature, _TIGHTEST))


USUAL = RoadOptions()


def ids_of(road_ids: str | Sequence[str]) -> list[str]:
    """Return ids of roads one by one."""
    return [one.strip() for one in (road_ids.split(",") if isinstance(road_ids, str) else road_ids)]


# Those that name something in a file or say how it is written, by what users call them.
OF_FILES = ("feature", "roles", "crs", "layer", "road_ids", "lane", "unit", *OF_POINTS)
OPTIONS = {name: fields_of(RoadOptions)[name].options[0] for name in OF_FILES}


def refuse_unheeded(what: str, options: object, *names: str) -> None:
    """Refuse those ``options`` of these ``names`` that were given, for ``what`` cannot heed them.

    Raises:
        RoadError: one was given.

    """
    given = next((name for name in names if getattr(options, name) not in {None, ()}), None)
    if given is not None:
        raise unheeded(what, given)


def unheeded(what: str, option: str) -> RoadError:
    """Return the refusal of a given ``option``, as readers of roads call it, that has no meaning for ``what``."""
    return RoadError(f"{what} has no use for {OPTIONS[option]}", hint=f"leave {OPTIONS[option]} out")
