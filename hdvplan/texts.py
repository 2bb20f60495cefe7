"""Text from outside, such as names in files and on the command line, made fit for where it is shown."""

from __future__ import annotations

_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def printable(text: str) -> str:
    """Return text on one line in which nothing steers a terminal: control and direction signs, and undecodable bytes, as escapes."""
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii") for sign in " ".join(text.split()))


def no_formula(cell: str) -> str:
    """Return a word for a table that spreadsheets open: what would begin a formula begins with an apostrophe."""
    return f"'{cell}" if cell.startswith(_FORMULA) and not _is_number(cell) else cell


def encoded(text: str) -> bytes:
    """Return text in UTF-8; what no file can hold, such as undecodable bytes of a file's name, becomes a question mark."""
    return text.encode("utf-8", "replace")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return cell == cell.strip()
