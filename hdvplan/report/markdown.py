"""Tables as Markdown."""

from __future__ import annotations

from collections.abc import Collection

import pandas as pd


def markdown_table(table: pd.DataFrame, *, text: Collection[str]) -> str:
    """Return a table, without its index, as Markdown that ends without a newline.

    Columns named in ``text`` are aligned left, the others right, as numbers are. Values stand as ``str`` has them; bars are escaped
    and line breaks become blanks, as both would end a cell.
    """
    cells = table.astype(str).map(_cell)
    cells.columns = pd.Index([_cell(str(name)) for name in table.columns])
    sides = ["left" if name in text else "right" for name in table.columns]
    return cells.to_markdown(index=False, disable_numparse=True, colalign=sides)


def _cell(value: str) -> str:
    return " ".join(value.replace("|", "\\|").split())
