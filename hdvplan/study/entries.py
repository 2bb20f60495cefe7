"""What a study's file may have as an entry: tables, lists without repetition, words, numbers, truth values; each refused by its name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hdvplan.errors import OptionError
from hdvplan.study.inputs import is_number


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
    return tuple(word(name, value) for value in list_of(entries, name))


def word(name: str, value: object) -> str:
    """Return a value that is a word."""
    if not isinstance(value, str):
        msg = f"the study's {name} must be words in quotes, not {value!r}"
        raise OptionError(msg)
    return value


def choice(name: str, value: object, choices: Sequence[str]) -> str:
    """Return a value that is one of the choices."""
    if value not in choices:
        msg = f"{name} must be {', '.join(choices[:-1])} or {choices[-1]}, not {value!r}"
        raise OptionError(msg)
    return str(value)


def number(name: str, value: object) -> float:
    """Return a value that is a finite number."""
    if not is_number(value):
        msg = f"the study's {name} must be a number, not {value!r}"
        raise OptionError(msg)
    return float(value)


def truth(name: str, value: object) -> bool:
    """Return a value that is true or false."""
    if not isinstance(value, bool):
        msg = f"the study's {name} must be true or false, not {value!r}"
        raise OptionError(msg)
    return value
