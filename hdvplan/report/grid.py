"""Tables from ready strings, for the terminal and as Markdown. It imports Rich alone: lists are there at once."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.cells import cell_len
from rich.table import Table
from rich.text import Text

from hdvplan.texts import printable

if TYPE_CHECKING:
    import pandas as pd

_LEAST = 20  # columns of text, in which remarks can still be read


def grid(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    text: Sequence[str] = (),
    one_line: Sequence[str] = (),
    caption: str | None = None,
) -> Table:
    """Return a table of ready strings; columns are right-aligned as numbers are, but for those named in ``text``.

    Where space is short, headings are broken, and text too or, in columns named in ``one_line``, cut, but keeps 20 columns. Words, numbers
    and the first column, which names the row, stay whole: a table that does not fit is wider than the terminal.
    """
    table = Table(title=Text(printable(title)), title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, pad_edge=False)
    if caption is not None:
        table.caption, table.caption_justify, table.caption_style = Text(printable(caption)), "left", ""
    lines = [[printable(cell) for cell in row] for row in rows]
    for number, column in enumerate(columns):
        header = column.replace(" [", "\n[")  # units on a line of their own
        cells, is_text = [line[number] for line in lines], column in text and number > 0
        whole = cells if not is_text else " ".join(cells).split() if column not in one_line else []
        widest = max(map(cell_len, [*header.split("\n"), *cells]))
        least = max(map(cell_len, [*header.split(), *whole, " " * min(widest, _LEAST * is_text)]))
        table.add_column(
            Text(header),  # as square brackets are markup in a string
            justify="left" if column in text else "right",
            overflow="fold",
            no_wrap=least == widest,
            min_width=least,
        )
    for line in lines:
        table.add_row(*(_cut(cell) if column in one_line else Text(cell) for column, cell in zip(columns, line, strict=True)))
    return table


def _cut(cell: str) -> Text:
    return Text(cell, no_wrap=True, overflow="ellipsis")


def markdown_table(table: pd.DataFrame, *, text: Collection[str]) -> str:
    """Return a table, without its index, as Markdown that ends without a newline.

    Columns named in ``text`` are aligned left, the others right, as numbers are. Values stand as ``str`` has them; bars are escaped
    and line breaks become blanks, as both would end a cell.
    """
    cells = table.astype(str).map(_on_one_line).rename(columns=lambda name: _on_one_line(str(name)))
    sides = ["left" if name in text else "right" for name in table.columns]
    return cells.to_markdown(index=False, disable_numparse=True, colalign=sides)


def _on_one_line(value: str) -> str:
    return " ".join(value.replace("|", "\\|").split())
