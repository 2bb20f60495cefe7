"""What a study's file may have as an entry: tables, lists without repetition, words, numbers, truth values; each refused by its name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import TypeGuard, TypeVar

from hdvplan.errors import OptionError
from hdvplan.spelling import did_you_mean

Kind = TypeVar("Kind")
MOST = 100_000  # values of one parameter, variants of one vehicle, combinations of settings
_KINDS: dict[type, str] = {str: "words in quotes", float: "a number", int: "a whole number", bool: "true or false"}


def entry(name: str, value: object, kind: type[Kind]) -> Kind:
    """Return an entry of a kind; a float is any finite number.

    Raises:
        OptionError: it is of another kind.

    """
    if not (is_number(value) if kind is float else isinstance(value, kind) and (kind is bool or not isinstance(value, bool))):
        msg = f"{name} must be {_KINDS[kind]}, not {value!r}"
        raise OptionError(msg)
    made: Kind = kind(value)  # type: ignore[call-arg] # each of the kinds takes a value
    return made


def is_number(value: object) -> TypeGuard[float]:
    """Tell whether an entry is a finite number: TOML's integers have no end."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:
        return False


def refuse_unknown(names: Mapping[str, object], known: Sequence[str], where: str, what: str = "entries") -> None:
    """Refuse names that are not known ``where``, by the first of them."""
    for name in names:
        if name not in known:
            msg = f"unknown entry {name!r} {where}"
            raise OptionError(msg, hint=did_you_mean(name, known, f"{what}: {', '.join(known)}"))


def refuse_many(count: int, what: str, most: int = MOST) -> None:
    """Refuse more combinations of what a study lists than can be kept in memory: more than ``most``."""
    if count > most:
        msg = f"the study asks for {count} {what}; {most} are the most"
        raise OptionError(msg, hint="make several studies of it")


def flattened(table: Mapping[str, object], before: str = "") -> dict[str, object]:
    """Return a table in which ``a.b`` may stand in quotes or not."""
    flat: dict[str, object] = {}
    for name, value in table.items():
        found = flattened(value, f"{before}{name}.") if isinstance(value, dict) else {before + name: value}
        if twice := found.keys() & flat.keys():
            msg = f"vary names {min(twice)!r} twice, with quotes and without"
            raise OptionError(msg)
        flat |= found
    return flat


def table_of(entries: Mapping[str, object], name: str) -> Mapping[str, object]:
    """Return an entry that is a table, empty where there is none."""
    value = entries.get(name, {})
    if not isinstance(value, Mapping):
        msg = f"the study's {name} must be a table, not {value!r}"
        raise OptionError(msg, hint=f"it begins with a line [{name}]")
    return value


def list_of(entries: Mapping[str, object], name: str, *, repeated: bool = False) -> list[object]:
    """Return an entry as a list, without repetition unless it may be ``repeated``; a single value is a list of one."""
    value = entries[name]
    values = list(value) if isinstance(value, list | tuple) else [value]
    if not values or (repeats(values) and not repeated):
        msg = f"{name} must name at least one entry, and none twice: {', '.join(map(str, values)) or 'nothing'}"
        raise OptionError(msg)
    return values


def repeats(values: Sequence[object]) -> bool:
    """Tell whether a value is there twice."""
    try:
        return len(set(values)) < len(values)
    except TypeError:  # tables have no hash; there are few of them
        return any(one in values[:place] for place, one in enumerate(values))


def words_of(entries: Mapping[str, object], name: str, otherwise: str | None = None) -> tuple[str, ...]:
    """Return an entry that is a list of words; ``otherwise`` where there is none."""
    if name not in entries and otherwise is not None:
        return (otherwise,)
    return tuple(entry(f"the study's {name}", value, str) for value in list_of(entries, name))


def choice(name: str, value: object, choices: Sequence[str]) -> str:
    """Return a value that is one of the choices."""
    if value not in choices:
        msg = f"{name} must be {', '.join(choices[:-1])} or {choices[-1]}, not {value!r}"
        raise OptionError(msg)
    return str(value)
