"""Settings that users choose: what each field of a dataclass means and which values it takes, told once, at the field.

``step: Annotated[float, Setting("Distance between stations [m].", "M", above=0.0)] = 0.5`` is an option ``--step M`` of commands, an entry
``step`` of files, and ``check`` holds it to its bounds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from enum import StrEnum
from functools import cache
from math import inf, isfinite
from numbers import Real
from types import NoneType
from typing import Any, get_args, get_type_hints

from hdvplan.errors import EntryError, OptionError


@dataclass(frozen=True)
class Setting:
    """What is told of a field; without ``words`` it is no option of any command."""

    words: str = ""  #: what help says, with the unit
    metavar: str | None = None  #: what stands for its value in help; None: its choices, and nothing for a flag
    names: tuple[str, ...] = ()  #: of its option, where they are not the field's
    above: float = -inf
    least: float = -inf
    most: float = inf
    choices: Sequence[str] = ()  #: the words that it takes; an enumeration's are its own
    listed: bool = False  #: several words are given with commas, instead of the option again


METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "ft": 0.3048, "in": 0.0254}  # units of lengths in files; exactly: the international foot
POSITIVE, NOT_NEGATIVE = Setting(above=0.0), Setting(least=0.0)


@dataclass(frozen=True)
class Field:
    """A field of settings: its type, without None where it may be left out, and what is told of it."""

    name: str
    kind: Any
    optional: bool
    default: object
    setting: Setting

    @property
    def choices(self) -> Sequence[str]:
        """The words that it takes, where only some."""
        return list(self.kind) if self.enumerated else self.setting.choices

    @property
    def enumerated(self) -> bool:
        """Whether it is a member of an enumeration of words."""
        return isinstance(self.kind, type) and issubclass(self.kind, StrEnum)

    @property
    def options(self) -> tuple[str, ...]:
        """The names of its option."""
        return self.setting.names or (f"--{self.name.replace('_', '-')}",)


@cache
def fields_of(kind: type) -> Mapping[str, Field]:
    """Return the fields of a dataclass by their names."""
    hints = get_type_hints(kind, include_extras=True)
    return {field.name: _field(field.name, hints[field.name], field.default) for field in fields(kind)}


def _field(name: str, hint: Any, default: object) -> Field:  # noqa: ANN401 - a type
    setting = next((extra for extra in getattr(hint, "__metadata__", ()) if isinstance(extra, Setting)), Setting())
    kind = hint.__origin__ if hasattr(hint, "__metadata__") else hint
    kinds = [one for one in get_args(kind) if one is not NoneType]
    optional = NoneType in get_args(kind)
    return Field(name, kinds[0] if optional and len(kinds) == 1 else kind, optional, default, setting)


def check(settings: Any) -> None:  # noqa: ANN401 - any dataclass
    """Refuse what is no number where one belongs, numbers that are not finite or outside their bounds, and words that are no choice.

    A word for a member of an enumeration becomes that member: members are told apart by identity.

    Raises:
        OptionError: there is one.

    """
    for name, field in fields_of(settings.__class__).items():
        value, setting = getattr(settings, name), field.setting
        if field.kind in {int, float} and not (field.optional and value is None):
            of_kind(name, value, Real)
        if isinstance(value, Real) and not (
            isfinite(value) and float(value) > setting.above and setting.least <= float(value) <= setting.most
        ):
            msg = f"{name} must be {_bounds(setting)}, not {value:g}"
            raise OptionError(msg)
        if isinstance(value, str) and field.choices:
            choice(name, value, field.choices)
            if field.enumerated:
                object.__setattr__(settings, name, field.kind(value))
        if setting.listed and ((not value and field.default) or len(set(value)) < len(value)):
            msg = f"{name} must name at least one entry, and none twice: {', '.join(map(str, value)) or 'nothing'}"
            raise OptionError(msg)


def _bounds(setting: Setting) -> str:
    if setting.most < inf:
        return f"above {setting.above:g} and at most {setting.most:g}"
    if setting.above == 0.0:
        return "a positive number"
    if setting.least > 0.0:
        return f"at least {setting.least:g}"
    return "zero or a positive number" if setting.least == 0.0 else "a finite number"


def choice(name: str, value: object, choices: Sequence[str]) -> str:
    """Return a value that is one of the choices.

    Raises:
        OptionError: it is none of them.

    """
    if value not in choices:
        msg = f"{name} must be {any_of(choices)}, not {value!r}"
        raise OptionError(msg)
    return str(value)


def of_kind(name: str, value: object, kind: type, hint: str | None = None, error: type[EntryError] = OptionError) -> None:
    """Refuse a value that is of another kind than its name needs, with ``error`` and the hint.

    Raises:
        EntryError: it is.

    """
    if not isinstance(value, kind):
        said = " ".join(repr(value).split())  # of an array several lines
        msg = f"{name} must be a {'number' if kind is Real else kind.__name__}, not {said:.60}"
        raise error(msg, field=name, hint=hint)


def any_of(choices: Sequence[str]) -> str:
    """Return words as a sentence lists them."""
    return " or ".join([", ".join(choices[:-1]), choices[-1]] if len(choices) > 1 else choices)
