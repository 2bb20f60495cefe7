"""Which manoeuvres of forward and backward legs there are, and the site of one, as options describe it. Light: ``--help`` reads it."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Annotated, NamedTuple

from hdvplan.errors import OptionError
from hdvplan.settings import Setting, check

_LARGEST_M = 200.0


class Template(StrEnum):
    """A manoeuvre in its site."""

    THREE_POINT = "three-point"
    HAMMERHEAD = "hammerhead"
    SIDE_HEAD = "side-head"
    DOCK_90 = "dock-90"
    DOCK_45 = "dock-45"

    @property
    def sentence(self) -> str:
        """What is driven, in one sentence."""
        return _ABOUT[self].sentence

    @property
    def sought(self) -> str:
        """The option that says how large the site is."""
        return _ABOUT[self].sought

    @property
    def others(self) -> tuple[str, ...]:
        """The options that say how large the rest of the site is."""
        return tuple(_option(name) for name in _ABOUT[self].heeded if name not in (self.sought, "clearance"))

    @property
    def words(self) -> str:
        """What the size is called."""
        return _ABOUT[self].words

    @property
    def docks(self) -> bool:
        """Whether the vehicle backs onto a dock; else it turns round."""
        return self.sought == "apron"


class _About(NamedTuple):
    sentence: str
    sought: str
    words: str
    heeded: tuple[str, ...]  # options


_HEAD = ("arm", "width", "kerb_radius", "overhang", "clearance")
_DOCK = ("apron", "door_spacing", "clearance")
_ABOUT = {
    Template.THREE_POINT: _About(
        "Turn round in a street between two walls or kerbs.", "width", "street width", ("width", "overhang", "clearance"),
    ),
    Template.HAMMERHEAD: _About(
        "Turn round in a head of two arms across the end of the road: into one, back into the other, out.", "arm", "head length", _HEAD,
    ),
    Template.SIDE_HEAD: _About(
        "Turn round by backing into an arm beside the road, and out of it.", "arm", "arm", (*_HEAD, "beyond"),
    ),
    Template.DOCK_90: _About("Back onto a dock square to the wall, between parked neighbours.", "apron", "apron", _DOCK),
    Template.DOCK_45: _About("Back onto a dock at 45 degrees to the wall, between parked neighbours.", "apron", "apron", _DOCK),
}  # fmt: skip


@dataclass(frozen=True)
class SiteOptions:
    """A site, as options describe it [m].

    Raises:
        OptionError: a length that is not positive, or longer than any site.

    """

    width: Annotated[float | None, Setting("Street width; in heads the carriageways' [m, 4.8].", "M", above=0.0)] = None
    arm: Annotated[
        float | None, Setting("Head from tip to tip; side-head: the arm from the road's kerb line to its tip [m].", "M", above=0.0)
    ] = None
    kerb_radius: Annotated[float | None, Setting("Radius of a head's kerbs [m, 6].", "M", least=0.0)] = None
    beyond: Annotated[float | None, Setting("How far the road goes on behind the arm of a side-head [m, without end].", "M", above=0.0)] = (
        None
    )
    apron: Annotated[float | None, Setting("From the doors to the other side of a dock's yard [m].", "M", above=0.0)] = None
    door_spacing: Annotated[float | None, Setting("Between the axes of vehicles at neighbouring doors [m, 4].", "M", above=0.0)] = None
    overhang: Annotated[float | None, Setting("How far bodies may reach over kerbs [m; three-point 0, heads 1].", "M", least=0.0)] = None
    clearance: Annotated[float | None, Setting("Room to keep from all that stands [m, 0].", "M", least=0.0)] = None

    def __post_init__(self) -> None:
        """Refuse what is no site."""
        check(self)
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and value > _LARGEST_M:
                msg = f"{field.name} = {value:g} m is more than any site has; at most {_LARGEST_M:g} m"
                raise OptionError(msg, hint="lengths are in metres")

    def size(self, template: Template) -> float | None:
        """Return the size of the site that is given, None where it is sought [m]."""
        size: float | None = getattr(self, template.sought)
        return size

    def refuse_all(self) -> None:
        """Refuse a site for a manoeuvre that has none.

        Raises:
            OptionError: an option is given.

        """
        for field in fields(self):
            if getattr(self, field.name) is not None:
                msg = f"{_option(field.name)} needs a template that reverses: {', '.join(Template)}"
                raise OptionError(msg)

    def check_heeded(self, template: Template) -> None:
        """Refuse options that mean nothing for a template.

        Raises:
            OptionError: one is given.

        """
        for field in fields(self):
            if field.name not in _ABOUT[template].heeded and getattr(self, field.name) is not None:
                heeded = ", ".join(_option(one.name) for one in fields(self) if one.name in _ABOUT[template].heeded)
                msg = f"{_option(field.name)} means nothing for {template}"
                raise OptionError(msg, hint=f"it takes {heeded}")


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def template_named(name: str | None) -> Template | None:
    """Return the manoeuvre of this name, None where it is none."""
    return Template(name) if name in list(Template) else None
