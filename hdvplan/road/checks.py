"""What no road file holds: files that are no texts, points impossibly far from their neighbours, lengths that only a wrong unit makes."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from hdvplan.arrays import FloatArray, chord_of, turns_of
from hdvplan.errors import RoadError
from hdvplan.road.crs import ToLonLat, is_local
from hdvplan.road.limits import WIDEST_M
from hdvplan.settings import METRES, any_of
from hdvplan.texts import place_text, some_of

_LARGEST_MB = 64
_PACKED = {".kmz", ".xlsx", ".ods"}  # packed by nature
_MARKS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))
_OTHERS = {
    b"\x1f\x8b": "compressed (gzip)",
    b"7z": "a 7z archive",
    b"Rar!": "a RAR archive",
    b"BZh": "compressed (bzip2)",
    b"\xfd7zXZ": "compressed (xz)",
}
_RATIO = 1000.0  # of a step to the median of those around it
_SHORTEST_M = 1000.0  # a long straight may well have one step of hundreds of metres between dense bends
_SAME_M = 0.02  # points this close repeat their neighbour
_BLAME_M, _CUT_SHARE = 20.0, 0.05  # around the place of a refusal, and of what lies before: smoothing has cut corners there
BACK = -np.cos(np.deg2rad(30.0))  # cosine of a turn at a point that is a mistake, or a drive back
_AROUND = 3  # steps looked at before and after
SPARSE_M = 1000.0  # between the points of a long line, on average: a small file makes no road of a thousand kilometres
MIN_LENGTH_M = 5.0  # of a road
MAX_LENGTH_M = 200e3  # of one that is smoothed at once, or given as a profile
LARGEST_M = 1e8  # beyond it a double's rounding of a position shows in the curvature
_IN_METRES = 6  # INSUNITS
_CODES = {  # what INSUNITS says, and how long that is [m]
    1: ("inches", METRES["in"]),
    2: ("feet", METRES["ft"]),
    4: ("millimetres", METRES["mm"]),
    5: ("centimetres", METRES["cm"]),
    _IN_METRES: ("metres", METRES["m"]),
    21: ("US survey feet", 1200.0 / 3937.0),
}
# Beyond these no line is a street's: one of 100 m is 100 km long in millimetres.
_LONGEST_M = 100e3
_NARROWEST_M = 0.25


def refuse_unreadable(path: Path, wanted: str = "road file") -> None:
    """Refuse a file that is too large to be a road, an archive, or encrypted; what is ``wanted`` is for the messages.

    Raises:
        RoadError: one of these; says what to do instead.
        OSError: the file cannot be opened.

    """
    size = path.stat().st_size
    if size > _LARGEST_MB * 1e6:
        msg = f"{path.name} has {size / 1e6:.0f} MB; {wanted}s of at most {_LARGEST_MB} MB are read"
        raise RoadError(msg, hint=f"take out the road first: ogr2ogr -spat XMIN YMIN XMAX YMAX road.gpkg {path.name}")
    with path.open("rb") as file:
        head = file.read(8)
    what = next((what for mark, what in _OTHERS.items() if head.startswith(mark)), None)
    if what is not None:
        msg = f"{path.name} is {what}, not a {wanted}"
        raise RoadError(msg, hint="unpack it, and give the file in it")
    if head.startswith(b"\xd0\xcf\x11\xe0"):
        msg = f"{path.name} is an old or an encrypted Office file"
        raise RoadError(msg, hint="save it without a password as .xlsx or .csv")
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        _refuse_archive(path, wanted)


def _refuse_archive(path: Path, wanted: str) -> None:
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
    except (zipfile.BadZipFile, NotImplementedError, ValueError) as error:
        msg = f"{path.name} is a damaged or cut-off archive"
        raise RoadError(msg, hint="fetch the file again") from error
    if any(member.flag_bits & 1 for member in members):
        msg = f"{path.name} is encrypted"
        raise RoadError(msg, hint="save it without a password")
    if path.suffix.lower() not in _PACKED:
        names = some_of((member.filename for member in members), 5)
        msg = f"{path.name} is a zip archive, not a {wanted}"
        raise RoadError(msg, hint=f"unpack it, and give the file in it: {names}" if names else "it is empty")
    unpacked = sum(member.file_size for member in members)
    if unpacked > _LARGEST_MB * 1e6:
        msg = f"{path.name} unpacks to {unpacked / 1e6:.0f} MB; {wanted}s of at most {_LARGEST_MB} MB are read"
        raise RoadError(msg, hint="take out the road first")


def text_of(path: Path, wanted: str = "road file") -> str:
    """Return a text file's text: UTF-8, or UTF-16 as its first bytes say, or else Windows-1252.

    Raises:
        RoadError: it is no text.
        OSError: the file cannot be read.

    """
    content = path.read_bytes()
    encoding = next((encoding for mark, encoding in _MARKS if content.startswith(mark)), None)
    try:
        try:
            text = content.decode(encoding or "utf-8")
        except UnicodeDecodeError:
            text = content.decode(encoding or "cp1252")
    except UnicodeDecodeError as error:
        msg = f"{wanted} {path} cannot be read: it is not text"
        raise RoadError(msg) from error
    if "\0" in text:
        msg = f"{wanted} {path} cannot be read: it is not text"
        raise RoadError(msg, hint=f"if it is a map in another form, make it a road file: ogr2ogr road.gpkg {path.name}")
    return text


def refuse_far(points: FloatArray, name: str) -> None:
    """Refuse points, shape (n, 2) [m], that lie where no map does, or nowhere.

    Raises:
        RoadError: such a point.

    """
    far = np.flatnonzero(~np.all(np.abs(points) <= LARGEST_M, axis=1))
    if far.size:
        x, y = points[far[0]]
        msg = f"{name}: point {far[0] + 1}, at {x:g}, {y:g} m, is too far out for a position"
        raise RoadError(msg, hint="are its coordinates metres? --unit names another unit of a file without a coordinate reference system")


def refuse_outliers(points: FloatArray, lines: tuple[int, ...] | None, name: str) -> None:
    """Refuse a line, shape (n, 2) [m], one of whose steps is thousands of times as long as those around it.

    ``lines`` are the lines of the points in their file, without which the message counts points.

    Raises:
        RoadError: such a step; says between which points.

    """
    steps = np.hypot(*np.diff(points, axis=0).T)
    for at in np.flatnonzero(steps > _SHORTEST_M).tolist():
        around = np.concatenate([steps[max(0, at - _AROUND) : at], steps[at + 1 : at + 1 + _AROUND]])
        around = around[around > _SAME_M]
        usual = float(np.sort(around)[(len(around) - 1) // 2]) if len(around) else np.inf  # the lower median
        if steps[at] > _RATIO * usual:
            first, second = (at + 1, at + 2) if lines is None else (lines[at], lines[at + 1])
            what = "points" if lines is None else "lines"
            msg = (
                f"{name}: {what} {first} and {second} are {steps[at] / 1e3:.3g} km apart,"
                f" {steps[at] / usual:.0f} times the steps around them"
            )
            raise RoadError(msg, hint="correct or remove the point that is wrong; on a long straight, add points between")


def named_point(at: int, lines: tuple[int, ...] | None) -> str:
    """Return what a message calls point ``at`` of a line, as its file has it; ``lines`` are those of the points in it."""
    return f"point {at + 1}" if lines is None else f"line {lines[at]} of the file"


def pointed_at(error: RoadError, points: FloatArray, lines: tuple[int, ...] | None, to_lonlat: ToLonLat | None) -> RoadError:
    """Return a refusal to smooth a line, shape (n, 2) [m], that says which of its points is to blame, as its file has it."""
    s = np.inf if error.s_m is None else error.s_m
    near = np.abs(chord_of(points)[1:-1] - s) <= _BLAME_M + _CUT_SHARE * min(s, MAX_LENGTH_M)
    if not np.any(near):
        return error
    at = 1 + int(np.argmin(np.where(near, turns_of(points), np.inf)))
    x, y = points[at].tolist()
    lonlat = None
    if to_lonlat is not None and is_local(to_lonlat):  # the file's coordinates are degrees
        lon, lat = np.ravel(to_lonlat(*points[at : at + 1].T))
        lonlat = (float(lon), float(lat))
    msg = f"{error} (sharpest at {named_point(at, lines)}, {place_text(x, y, lonlat)})"
    return RoadError(msg, s_m=error.s_m, hint=error.hint)


def refuse_length(points: FloatArray, name: str, long: float, given: str | None = None) -> None:
    """Refuse a line, shape (n, 2) [m], longer than ``long`` with fewer than one point a kilometre: it would lead straight across a country.

    Where the option ``given``, such as ``--unit mm``, says what its coordinates are, one that is shorter than any road is refused as well.

    Raises:
        RoadError: such a line.

    """
    length = _length_of([points])
    right = "are its coordinates right?" if given is None else f"are its coordinates as {given} says?"
    if length > max(long, SPARSE_M * len(points)):
        msg = f"{name}: the line is {length / 1e3:.0f} km long, but has only {len(points)} points"
        raise RoadError(msg, hint=f"a line of more than {long / 1e3:.0f} km needs one a kilometre; {right}")
    if given is not None and 0.0 < length < MIN_LENGTH_M:
        msg = f"{name}: with {given} the road is {length:.2g} m long; at least {MIN_LENGTH_M:g} m are needed"
        raise RoadError(msg, hint=right)


@dataclass(frozen=True)
class Unit:
    """The unit of a file without a coordinate reference system: as ``given`` by the user, else as INSUNITS (``code``) says, else metres.

    ``code`` is None of files that are no drawings, 0 of drawings that say no unit.
    """

    given: str | None = None
    code: int | None = None

    @property
    def metres(self) -> float:
        """Its length [m]."""
        return METRES[self.given] if self.given is not None else _CODES.get(self.code or 0, ("", 1.0))[1]

    @property
    def words(self) -> str:
        """What the file says of it, to follow the file's name."""
        return f"says {_CODES[self.code][0]} (INSUNITS {self.code})" if self.code in _CODES else "says no unit"

    def notes(self, name: str, system: str | None) -> tuple[str, ...]:
        """Return a note on how a drawing in the ``system`` is read, none where it is read in metres and says so."""
        if self.given is not None or self.code in {None, _IN_METRES} or (system is not None and self.code not in _CODES):
            return ()
        if system is not None:
            return (f"{name} {self.words}; its coordinates are read as those of {system}",)
        words = "in these" if self.code in _CODES else "as metres"
        return (f"{name} {self.words}; its coordinates are read {words}, unless --unit says otherwise",)


def refuse_no_street(
    parts: Sequence[FloatArray],
    reaches: FloatArray | None,
    edges: Sequence[FloatArray],
    unit: Unit,
    name: str,
    lines: tuple[int, ...] | None = None,
) -> None:
    """Refuse a line that only a wrong unit can have made, unless the user gave the unit; ``name`` begins the message.

    ``parts`` of the line, in any order, and ``edges`` have shape (n, 2) [m]; ``reaches`` and ``lines`` are as in ``RawRoad``.

    Raises:
        RoadError: no street is as short, long, narrow or wide, or has points so far apart, or as ``refuse_outliers``.

    """
    if unit.given is not None or not all(np.all(np.abs(part) <= LARGEST_M) for part in parts):  # which ``refuse_far`` tells
        return
    odd = _oddity(parts, reaches, edges, drawn=unit.code is not None)
    if odd is not None:
        for part in parts:
            refuse_outliers(part, lines, name)  # one wrong point is no wrong unit
        msg = f"{name} {unit.words}, and {'in these' if unit.code in _CODES else 'in metres'} {odd}, as of no street"
        length = _length_of(parts) / unit.metres
        usual = [one for one, metres in METRES.items() if MIN_LENGTH_M <= metres * length <= _LONGEST_M]
        kilometres = "no --unit makes it a road: if these are kilometres, write them in metres"
        raise RoadError(msg, hint=f"say its unit: --unit {any_of(usual)}" if usual else kilometres)


def _oddity(parts: Sequence[FloatArray], reaches: FloatArray | None, edges: Sequence[FloatArray], *, drawn: bool) -> str | None:
    """Return what no street has, None of what may be one."""
    length, steps = _length_of(parts), sum(len(part) - 1 for part in parts)
    if length > 0.0 and not MIN_LENGTH_M <= length <= _LONGEST_M:  # nothing is short in any unit
        return f"its line is {_told(length)} long"
    if length > SPARSE_M * steps and (drawn or steps > 1):
        return f"the points of its line are {_told(length / steps)} apart"
    if reaches is not None:
        left, right = np.median(reaches[:2], axis=1).tolist()
        return f"its limits are {_told(left + right)} apart" if min(left, right) > WIDEST_M or left + right < 2.0 * _NARROWEST_M else None
    if edges:
        line = shapely.MultiLineString(list(parts))
        shapely.prepare(line)
        points = np.concatenate(list(edges))
        drawn_beside = shapely.linestrings(points, indices=np.repeat(np.arange(len(edges)), [len(edge) for edge in edges]))
        if not np.any(shapely.dwithin(line, drawn_beside, WIDEST_M)):
            return f"its edges are more than {_told(WIDEST_M)} from its line"
        if np.all(shapely.dwithin(line, shapely.points(points), _NARROWEST_M)):
            return f"its edges are within {_told(_NARROWEST_M)} of its line"
    return None


def _told(length: float) -> str:
    return f"{length / 1e3:.4g} km" if length >= 1e3 else f"{length:.3g} m"  # noqa: PLR2004 - of a kilometre


def _length_of(parts: Sequence[FloatArray]) -> float:
    return sum(float(np.sum(np.hypot(*np.diff(part, axis=0).T))) for part in parts)
