"""Text from outside, such as names in files and on the command line: made fit for where it is shown, and what a misspelt name may mean."""

from __future__ import annotations

from collections.abc import Iterable

_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_LETTERS_AN_ERROR = 4  # one wrong letter in every four is still read as a misspelling
_SHORTEST_PART = 4  # letters by which a part of a longer name is recognised
_MOST_SHOWN = 3  # names in a hint; a part that more names contain says nothing


def printable(text: str) -> str:
    """Return text on one line in which nothing steers a terminal: control and direction signs, and undecodable bytes, as escapes."""
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii") for sign in " ".join(text.split()))


def some_of(names: Iterable[str], most: int) -> str:
    """Return so many names at most, with a sign that there are more."""
    listed = list(names)
    return ", ".join(listed[:most]) + (", ..." if len(listed) > most else "")


def counted(count: int, one: str, several: str = "") -> str:
    """Return how many there are of what is called ``one``, and ``several`` or with an s where it is not one."""
    return f"{count} {one if count == 1 else several or f'{one}s'}"


def place_text(x: float, y: float, lonlat: tuple[float, float] | None) -> str:
    """Return a place as people read it: latitude and longitude [deg], or x and y [m] where there are none."""
    if lonlat is None:
        return f"x {x:z.1f}, y {y:z.1f}"
    lon, lat = lonlat
    return f"{abs(lat):.5f} {'N' if lat >= 0.0 else 'S'}, {abs(lon):.5f} {'E' if lon >= 0.0 else 'W'}"


def no_formula(cell: str) -> str:
    """Return a word for a table that spreadsheets open: what would begin a formula begins with an apostrophe."""
    return f"'{cell}" if cell.startswith(_FORMULA) and not is_number(cell) else cell


def encoded(text: str) -> bytes:
    """Return text in UTF-8; what no file can hold, such as undecodable bytes of a file's name, becomes a question mark."""
    return text.encode("utf-8", "replace")


def is_number(cell: str) -> bool:
    """Tell whether a cell of a table is a number, without anything around it."""
    try:
        float(cell)
    except ValueError:
        return False
    return cell == cell.strip()


def meant_by(name: str, known: Iterable[str]) -> list[str]:
    """Return the known names that ``name`` may have meant, the nearest ones; none if nothing is near. Capitals do not matter."""
    names, given = list(known), name.casefold()
    most = max(1, round(sum(map(str.isalnum, given)) / _LETTERS_AN_ERROR))
    near = [other for other in names if abs(len(other.casefold()) - len(given)) <= most]  # a name of a megabyte is compared to none
    distances = {other: _distance(given, other.casefold()) for other in near}
    nearest = min(distances.values(), default=len(given))
    if nearest <= most and 2 * nearest < len(given):
        return [other for other, distance in distances.items() if distance == nearest]
    longer = [other for other in names if len(given) >= _SHORTEST_PART and given in other.casefold()]
    return longer if len(longer) <= _MOST_SHOWN else []


def did_you_mean(name: str, known: Iterable[str], otherwise: str) -> str:
    """Return the hint for a name that nobody knows: up to three known ones that it may have meant; ``otherwise`` where none is near."""
    meant = meant_by(name, known)
    return f"did you mean {' or '.join(map(repr, meant[:_MOST_SHOWN]))}?" if meant else otherwise


def _distance(one: str, other: str) -> int:
    """Return how many letters must be inserted, deleted, replaced or exchanged with their neighbour (optimal string alignment)."""
    before: list[int] = []
    last = list(range(len(other) + 1))
    for i, letter in enumerate(one, start=1):
        row = [i]
        for j, second in enumerate(other, start=1):
            cost = min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (letter != second))
            if i > 1 and j > 1 and letter == other[j - 2] and one[i - 2] == second:
                cost = min(cost, before[j - 2] + 1)
            row.append(cost)
        before, last = last, row
    return last[-1]
