"""Files before they are read: what is too large, packed or encrypted, and texts in the encodings that spreadsheets write."""

from __future__ import annotations

import zipfile
from pathlib import Path

from hdvplan.errors import RoadError

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
        names = ", ".join(member.filename for member in members[:5]) + (", ..." if len(members) > 5 else "")  # noqa: PLR2004
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
