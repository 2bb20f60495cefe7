"""Damage to files: numbers that are a little or far off, lines and pieces that go missing, come twice or change places, wrong bytes."""

from __future__ import annotations

import random
import re

_NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")
_NUMBERS = (
    b"0", b"-0", b"1e-300", b"1e300", b"-1e9", b"1e400", b"nan", b"inf", b"-1", b"1", b"180", b"90.0000001", b"0.1", b"1e-9", b"00", b"1_0",
    b"9" * 400, b"0x10", b"1,5", b"", b"null", b"true", b'"1"', b"[]", b"{}",
)  # fmt: skip
_WORDS = (
    b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n\n", b'"', b"'", b",", b";", b"\t", b"=1+1", b"[red]", b"\x1b[31m", b"<b>", b"$x$",
    "ä\u202e".encode(), b"[" * 3000, b"#", b"&amp;", b"<!DOCTYPE a [<!ENTITY b 'c'>]>", b"a" * 300, b"%s", b"../", b"\\",
)  # fmt: skip


def mutated(content: bytes, rng: random.Random) -> bytes:
    """Return a file's content with some damage: six times in seven to a few numbers alone, most of them slight."""
    if rng.random() < 0.85 and _NUMBER.search(content):
        for _ in range(rng.choice((1, 1, 1, 2, 4))):
            content = _renumbered(content, rng, far=rng.random() < 0.12)
        return content
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        content = rng.choice((_cut, _dropped, _doubled, _swapped, _flipped, _inserted))(content, rng)
    return content


def _renumbered(content: bytes, rng: random.Random, *, far: bool) -> bytes:
    found = list(_NUMBER.finditer(content))
    if not found:
        return content
    one = rng.choice(found)
    if far:
        new = rng.choice(_NUMBERS)
    else:
        value = float(one[0]) if len(one[0]) < 300 else 0.0
        digits = len(one[0].partition(b".")[2]) or 1
        new = f"{value + rng.choice((1.0, 3.0, 10.0, 0.0)) * 10.0 ** -rng.randint(0, digits) * rng.uniform(-1.0, 1.0):.{digits}f}".encode()
    return content[: one.start()] + new + content[one.end() :]


def _cut(content: bytes, rng: random.Random) -> bytes:
    return content[: rng.randint(0, len(content))]


def _dropped(content: bytes, rng: random.Random) -> bytes:
    begin, end = _piece(content, rng)
    return content[:begin] + content[end:]


def _doubled(content: bytes, rng: random.Random) -> bytes:
    begin, end = _piece(content, rng)
    return content[:end] + content[begin:end] * rng.choice((1, 1, 2, 50)) + content[end:]


def _swapped(content: bytes, rng: random.Random) -> bytes:
    lines = content.split(b"\n")
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[one], lines[other] = lines[other], lines[one]
    return b"\n".join(lines)


def _flipped(content: bytes, rng: random.Random) -> bytes:
    flipped = bytearray(content)
    for _ in range(rng.choice((1, 1, 4, 32)) if flipped else 0):
        flipped[rng.randrange(len(flipped))] = rng.randrange(256)
    return bytes(flipped)


def _inserted(content: bytes, rng: random.Random) -> bytes:
    at = rng.randint(0, len(content))
    return content[:at] + rng.choice((*_WORDS, *_NUMBERS)) + content[at:]


def _piece(content: bytes, rng: random.Random) -> tuple[int, int]:
    """Return where a piece begins and ends: one line, or up to a hundred bytes."""
    begin = rng.randint(0, len(content))
    if rng.random() < 0.5:
        begin = content.rfind(b"\n", 0, begin) + 1
        end = content.find(b"\n", begin)
        return begin, len(content) if end < 0 else end + 1
    return begin, min(begin + rng.randint(1, 100), len(content))
