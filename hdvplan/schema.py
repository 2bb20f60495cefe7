"""Tables of TOML, and dictionaries like them, as dataclasses: every entry of the kind that its field has, and none that has no field.

msgspec holds the entries to a form that is made of the dataclass; what it refuses is told here in the words of users.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import StrEnum
from functools import cache, reduce
from operator import or_
from pathlib import Path
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints, is_typeddict

import msgspec

from hdvplan.errors import EntryError, OptionError
from hdvplan.settings import any_of
from hdvplan.texts import did_you_mean, meant_by

Kind = TypeVar("Kind")
_KINDS = {str: ["words in quotes"], float: ["a number"], int: ["a whole number"], bool: ["true", "false"], dict: ["a table"]}
_PLACE = re.compile(r" - at `\$(.*)`$")
_STEP = re.compile(r"([^.\[\]]+)(?:\[(\d+)\])?")
_UNKNOWN, _MISSING = re.compile(r"Object contains unknown field `(.*?)`"), re.compile(r"Object missing required field `(.*?)`")

_LONGEST_TEXT = 16_000_000  # letters of a text by hand, or by a script: a study of 100,000 roads
_INTEGER_BITS = 64


def read_text(path: Path) -> str:
    """Return a text that somebody wrote, such as TOML; it may come from a pipe, but not without end.

    Raises:
        OSError: it cannot be read.
        ValueError: it is not UTF-8, too long, or ``path`` is no path.

    """
    with path.open(encoding="utf-8") as file:
        text = file.read(_LONGEST_TEXT + 1)
    if len(text) > _LONGEST_TEXT:
        msg = f"it has more than {_LONGEST_TEXT / 1e6:.0f} MB"
        raise ValueError(msg)
    return text


def parse_toml(text: str) -> dict[str, object]:
    """Return the entries of a TOML text.

    Raises:
        ValueError: not TOML, nested too deeply, or with an integer of over 64 bits, which TOML 1.0 need not hold and no message can print.

    """
    try:
        document = tomllib.loads(text)
    except RecursionError as error:
        msg = "it is nested too deeply"
        raise ValueError(msg) from error
    ahead: list[tuple[str, object]] = list(document.items())
    while ahead:
        key, value = ahead.pop()
        if isinstance(value, int) and value.bit_length() >= _INTEGER_BITS:
            msg = f"{key} is too large a number"
            raise ValueError(msg)
        ahead += value.items() if isinstance(value, dict) else [(key, one) for one in value] if isinstance(value, list) else ()
    return document


def read_toml(path: Path, what: str, *, hint: str | None = None) -> dict[str, object]:
    """Return the entries of a TOML file; ``what`` it is, and a ``hint`` where it is not TOML, are for the message.

    Raises:
        OptionError: no such file, or not TOML.

    """
    try:
        return parse_toml(read_text(path))
    except OSError as error:
        msg = f"{what} {path} cannot be read: {error.strerror or error}"
        raise OptionError(msg) from error
    except ValueError as error:  # also of its encoding
        msg = f"{what} {path} is not valid TOML: {error}"
        raise OptionError(msg, hint=hint) from error


def read(kind: type[Kind], table: Mapping[str, object], where: str, error: type[EntryError] = OptionError) -> Kind:
    """Return the dataclass that a table's entries make; ``where`` it stands is for messages.

    Raises:
        EntryError: ``error``, for an unknown or missing entry, or one of another kind.

    """
    made: Kind = kind(**entries(kind, table, where, error))
    return made


def entries(
    kind: type, table: Mapping[str, object], where: str, error: type[EntryError] = OptionError, *, single: bool = False
) -> dict[str, Any]:
    """Return those entries of a table that are there, as the fields of a dataclass have them.

    With ``single`` a value where a list is expected is a list of one.

    Raises:
        EntryError: see ``read``.

    """
    plain = _plain(table, kind if single else object)
    try:
        return _given(kind, msgspec.convert(plain, _form(kind)))
    except msgspec.ValidationError as refused:
        raise _refusal(kind, plain, str(refused), where, error) from None


@cache
def _form(kind: Any) -> Any:  # noqa: ANN401 - a type
    """Return a type as msgspec checks it: of a dataclass a structure that knows its fields and no others."""
    if _is_table(kind):
        named = {name: _form(hint) for name, hint in get_type_hints(kind).items()}
        others = [(name, form | msgspec.UnsetType, msgspec.UNSET) for name, form in named.items() if name not in _needed(kind)]
        needed = [(name, form) for name, form in named.items() if name in _needed(kind)]
        return msgspec.defstruct("Table", [*needed, *others], forbid_unknown_fields=True)
    if get_origin(kind) in {Union, UnionType}:
        return reduce(or_, map(_form, get_args(kind)))
    return tuple.__class_getitem__((_form(get_args(kind)[0]), ...)) if _is_list(kind) else kind


def _is_table(kind: Any) -> bool:  # noqa: ANN401 - a type
    return is_dataclass(kind) or is_typeddict(kind)


def _needed(kind: Any) -> Collection[str]:  # noqa: ANN401 - a type
    if not is_dataclass(kind):
        return frozenset(kind.__required_keys__)
    return {field.name for field in fields(kind) if field.default is MISSING and field.default_factory is MISSING}


def _given(kind: type, found: object) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {name: _made(hint, value) for name, hint in hints.items() if (value := getattr(found, name)) is not msgspec.UNSET}


def _made(kind: Any, value: object) -> object:  # noqa: ANN401 - a type
    own = _within(kind, _is_table)
    if isinstance(value, tuple) and own is not None:
        return tuple(_made(kind, one) for one in value)
    return own(**_given(own, value)) if isinstance(value, msgspec.Struct) else value


def _plain(value: Any, kind: Any = object) -> Any:  # noqa: ANN401 - a value of any kind
    """Return a value of which every part is of Python's own types, as TOML has them; a list of one where ``kind`` has a list of values."""
    if isinstance(value, Mapping):
        hints = get_type_hints(own) if (own := _within(kind, _is_table)) else {}
        return {str(name): _plain(one, hints.get(name, object)) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one, own if (own := _within(kind, _is_table)) else object) for one in value]
    if isinstance(value, str | float):  # words of an enumeration, numbers of NumPy
        value = str(value) if isinstance(value, str) else float(value)
    return [value] if _within(kind, _is_list) and value is not None else value


def _within(kind: Any, wanted: Callable[[Any], bool]) -> Any:  # noqa: ANN401 - types
    """Return the first type of a kind within another, or None."""
    return kind if wanted(kind) else next((found for one in get_args(kind) if (found := _within(one, wanted)) is not None), None)


def _is_list(kind: Any) -> bool:  # noqa: ANN401 - a type
    return get_origin(kind) is tuple


def _refusal(kind: Any, table: Any, message: str, where: str, error: type[EntryError]) -> EntryError:  # noqa: ANN401 - a type, a table
    """Return in the words of users what msgspec refuses: where, which entry, what was expected, and what a misspelt name may mean."""
    place = _PLACE.search(message)
    steps = _STEP.findall(place[1] if place else "")
    unknown, missing = _UNKNOWN.match(message), _MISSING.match(message)
    top = list(get_type_hints(kind)) if steps else []
    for name, number in steps if unknown or missing else steps[:-1]:  # tables on the way to the entry
        kind, table = _within(get_type_hints(kind)[name], _is_table), table[name][int(number)] if number else table[name]
        where = f"{where}, {name} {int(number) + 1}" if number else f"{where}, {name}"
    known = list(get_type_hints(kind))
    if unknown:
        above = [] if meant_by(unknown[1], known) else meant_by(unknown[1], top)
        listed = f"write {above[0]} at the top of the file, before all [tables]" if above else f"known entries: {', '.join(known)}"
        tables = {name: _within(_inner(one), _is_table) for name, one in get_type_hints(kind).items() if _within(one, _is_list)}
        below = [name for name, one in tables.items() if one is not None and unknown[1] in get_type_hints(one)]
        hint = f"it is an entry of [[{below[0]}]]" if below else did_you_mean(unknown[1], known, listed)
        return error(f"{where}: unknown entry {unknown[1]!r}", field=unknown[1], hint=hint)
    if missing:
        return error(f"{where}: {missing[1]} is missing", field=missing[1], hint=f"known entries: {', '.join(known)}")
    name, number = steps[-1]
    kind, value = get_type_hints(kind)[name], table[name]
    if number and not _is_table(_inner(kind)):  # one of a list
        kind, value = _inner(kind), value[int(number)]
    return error(f"{where}: {name} must be {any_of(_words(kind, name))}, not {value!r}", field=name)


def _inner(kind: Any) -> Any:  # noqa: ANN401 - types
    return get_args(_within(kind, _is_list))[0]


def _words(kind: Any, name: str) -> list[str]:  # noqa: ANN401 - a type
    if get_origin(kind) in {Union, UnionType}:
        return [word for one in get_args(kind) for word in _words(one, name)]
    if get_origin(kind) is Literal:
        return [f"{word!r}" for word in get_args(kind)]
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        return list(kind)
    if _is_list(kind):
        inner = get_args(kind)[0]
        return [f"[[{name}]] tables" if _is_table(inner) else {str: "a list of names", float: "a list of numbers"}.get(inner, "a list")]
    return [f"a table, [{name}]"] if _is_table(kind) else _KINDS.get(get_origin(kind) or kind, [])
