"""Options made of the fields of settings: their names, words, units, choices and defaults stand there, and nowhere else."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import wraps
from typing import Annotated, Any, get_args, get_origin

import typer

from hdvplan.cli import completion
from hdvplan.settings import Field, choice, fields_of

_COMPLETED = {
    "solver": completion.solvers,
    "solvers": completion.listed(completion.solvers),
    "objective": completion.objectives,
    "vehicles": completion.listed(completion.vehicles),
    "roads": completion.listed(completion.roads),
    "template": completion.templates,
}


@dataclass(frozen=True)
class OptionsOf:
    """What a command offers of settings: ``only`` some of them, in a group of its help; ``groups`` and ``words`` are of those that differ.

    The command receives the settings; with ``given`` a dictionary of what the user gave, which another source completes.
    """

    kind: Any
    group: str
    groups: Mapping[str, str] = field(default_factory=dict)
    words: Mapping[str, str] = field(default_factory=dict)
    only: tuple[str, ...] = ()
    given: bool = False

    def parameters(self) -> dict[str, inspect.Parameter]:
        """Return the options as parameters for Typer, by the names of their fields."""
        fields = {name: one for name, one in fields_of(self.kind).items() if one.setting.words and (not self.only or name in self.only)}
        return {name: self._parameter(one) for name, one in fields.items()}

    def _parameter(self, field: Field) -> inspect.Parameter:
        (kind, many), least = _typed(field), field.setting.least
        default = None if self.given or many else field.default
        shown = typer.Option(
            *field.options,
            metavar=field.setting.metavar or "|".join(field.choices) or None,
            help=self.words.get(field.name, field.setting.words) + (f" At least {least:g}." if least > 0.0 else ""),
            autocompletion=completion.one_of(field.choices) if field.choices else _COMPLETED.get(field.name),
            rich_help_panel=self.groups.get(field.name, self.group),
        )
        annotation: Any = Annotated[kind if default is not None else kind | None, shown]
        return inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)

    def made(self, values: dict[str, Any]) -> Any:  # noqa: ANN401 - the settings
        """Return what the command receives, of what the user gave; an ``OptionError`` where a value is outside its range."""
        fields = fields_of(self.kind)
        chosen = {name: _chosen(fields[name], value) for name, value in values.items() if value is not None}
        return chosen if self.given else self.kind(**chosen)


def _typed(field: Field) -> tuple[Any, bool]:
    if get_origin(field.kind) is tuple:
        return (str, False) if field.setting.listed else (list[str], True)
    if get_args(field.kind) or (isinstance(field.kind, type) and issubclass(field.kind, StrEnum)):
        return str, False
    return field.kind, False


def _chosen(field: Field, value: Any) -> Any:  # noqa: ANN401 - of any field
    if field.choices and isinstance(value, str):
        return field.kind(choice(field.options[0], value, field.choices))
    if get_origin(field.kind) is tuple:
        return tuple(value) if isinstance(value, list) else tuple(one.strip() for one in value.split(",") if one.strip())
    return value


def with_settings(command: Callable[..., int]) -> Callable[..., int]:
    """Give a command the options of its settings in the place of each parameter that is annotated with ``OptionsOf``."""
    own = inspect.signature(command, eval_str=True).parameters
    parts = {name: part for name, mine in own.items() for part in get_args(mine.annotation)[1:] if isinstance(part, OptionsOf)}
    options = {name: part.parameters() for name, part in parts.items()}

    @wraps(command)
    def run(**given: Any) -> int:  # noqa: ANN401 - options
        for name, part in parts.items():
            given[name] = part.made({field: given.pop(field) for field in options[name]})
        return command(**given)

    shown = [one for name, mine in own.items() for one in (options[name].values() if name in parts else [mine])]
    run.__signature__ = inspect.Signature([one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in shown])  # type: ignore[attr-defined] # where Typer looks for them
    return run
