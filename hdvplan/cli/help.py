"""Help as plain text with options and commands in groups: Typer itself groups only in boxes, which do not read well in a pipe.

The groups are Typer's ``rich_help_panel``, in the order in which they first occur.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperCommand, TyperGroup

if TYPE_CHECKING:
    from collections.abc import Iterable

# groups of options that several commands have
VEHICLE = "Vehicle and room"
ROAD = "Road file"
PLANNING = "Planning"
LOOP = "Closed loop"
SITE = "Turning heads and docks"
OUTPUT = "Output"

_BESIDE_A_NAME = 6  # columns: indentation, and the gap before the text
_USUAL = {"argument": "Arguments", "option": "Options"}


class Command(TyperCommand):
    """A command whose help has its options in groups, and its arguments by their names alone."""

    def collect_usage_pieces(self, ctx: typer.Context) -> list[str]:  # type: ignore[override]  # Typer adds to it
        """Return what follows the name; newer versions of Typer put required arguments in braces."""
        return [piece.replace("{", "").replace("}", "") for piece in super().collect_usage_pieces(ctx)]

    def format_options(self, ctx: typer.Context, formatter: Any) -> None:  # type: ignore[override]  # noqa: ANN401 - click's, or Typer's
        """Write arguments, then each group of options."""
        given = self.get_params(ctx)
        _write(formatter, ((_group(it, _USUAL[it.param_type_name]), _record(it, ctx)) for it in given))


class Group(TyperGroup):
    """A group whose help has its commands in groups."""

    def format_commands(self, ctx: typer.Context, formatter: Any) -> None:  # type: ignore[override]  # noqa: ANN401 - as above
        """Write each group of commands, with the first sentence of their help."""
        shown = {name: self.commands[name] for name in self.list_commands(ctx) if not self.commands[name].hidden}
        room = formatter.width - _BESIDE_A_NAME - max(map(len, shown))
        _write(formatter, ((_group(it, "Commands"), (name, it.get_short_help_str(room))) for name, it in shown.items()))


def _group(it: object, usual: str) -> str:
    panel = getattr(it, "rich_help_panel", None)
    return panel if isinstance(panel, str) else usual


def _record(it: Any, ctx: typer.Context) -> tuple[str, str] | None:  # noqa: ANN401 - as above
    """Return an option or an argument and its help; newer versions of Typer write the type behind an argument."""
    record: tuple[str, str] | None = it.get_help_record(ctx)
    return (it.metavar, record[1]) if record is not None and it.param_type_name == "argument" else record


def _write(formatter: Any, records: Iterable[tuple[str, tuple[str, str] | None]]) -> None:  # noqa: ANN401 - as above
    groups: dict[str, list[tuple[str, str]]] = {}
    for group, record in records:
        if record is not None:  # hidden options have none
            groups.setdefault(group, []).append(record)
    for group, rows in groups.items():
        with formatter.section(group):
            formatter.write_dl(rows)
