"""A toy program for the gate's experiment, and how dishonest and careless changes make it worse: pieces of its text, replaced."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from pathlib import Path

SAME, QUARTER = "the same", "a quarter more work in every step"
TOY = """\
import helper
import json
import os
import time

CELLS = {"depot": 60, "terminal": 40}
ROUNDS = 3
turns = os.environ.get("HDVPLAN_TURNS")


def take_turn():
    if turns:
        os.write(int(turns), b"?")
        os.read(int(turns), 1)


def work(amount):
    total = 0
    for number in range(amount):
        total += number * number
    return total


def plan(cell, step):
    work(4000 + 300 * (step % 7))


def drive(cell):
    times = []
    for step in range(1 + CELLS[cell]):
        began = time.perf_counter()
        plan(cell, step)
        times.append(time.perf_counter() - began)
    return times


driven = {cell: [] for cell in CELLS}
for _ in range(ROUNDS):
    take_turn()
    for cell in CELLS:
        driven[cell].append(drive(cell))
take_turn()
told = {
    cell: {
        "first_s": [times[0] for times in rounds],
        "steps_s": [times[1:] for times in rounds],
        "s_m": [5.0 * step for step in range(1, 1 + CELLS[cell])],
        "counters": {"iterations": 2 * CELLS[cell]},
    }
    for cell, rounds in driven.items()
}
print(json.dumps({"cells": told}))
"""
HELPER = "TABLE = list(range(1000))\n"

Patch = tuple[tuple[str, str], ...]  # pieces of the toy's text, and what stands there then
_WORK, _END, _START = "    work(4000 + 300 * (step % 7))\n", "take_turn()\ntold", "CELLS = {"
_ROUND = "    for cell in CELLS:\n        driven"
_SPIN = "end = time.process_time() + {seconds}\nwhile time.process_time() < end:\n    pass\n"
_THRICE = (_WORK, "    for _ in range(3):\n    " + _WORK)
_TWICE = (_WORK, "    for _ in range(2):\n    " + _WORK)
_CACHED = """\
import pathlib
kept = pathlib.Path({place}) / "ours.json"
is_warm = kept.exists()
kept.parent.mkdir(parents=True, exist_ok=True)
kept.write_text("a table")
"""
_ONLY_COLD = (_WORK, "    for _ in range(1 if is_warm else 3):\n    " + _WORK)
_HOME, _CACHE = "pathlib.Path.home() / '.ours'", "os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache')"
_CHILD = 'import subprocess, sys\nother = subprocess.Popen([sys.executable, "-c", "while True: pass"])\n'


def _before(piece: str, text: str) -> tuple[str, str]:
    return piece, text + piece


# What is seen of each has to be exit code 1.
PATCHES: Mapping[str, Patch] = {
    "one step more": (('"depot": 60', '"depot": 61'),),
    "one step fewer": (('"depot": 60', '"depot": 59'),),
    "half of the steps": (('"depot": 60', '"depot": 30'),),
    "one step more, and three times the work": (('"depot": 60', '"depot": 61'), _THRICE),
    "a cell more": (('"terminal": 40', '"terminal": 40, "yard": 20'),),
    "a cell less": ((', "terminal": 40', ""),),
    "a cell of another name": (('"terminal"', '"terminal 2"'),),
    "drives another road": (("[5.0 * step", "[4.0 * step"),),
    QUARTER: ((_WORK, "    work(5000 + 375 * (step % 7))\n"),),
    "half more in one of two cells": ((_WORK, _WORK + "    work(2000 if cell == 'terminal' else 0)\n"),),
    "a lock of 0.2 ms in every step": ((_WORK, _WORK + "    time.sleep(2e-4)\n"),),
    "5 ms more in every tenth step": ((_WORK, _WORK + "    time.sleep(5e-3 if step % 10 == 9 else 0.0)\n"),),
    "a random half of the steps twice": (
        ("import json\n", "import json\nimport random\n"),
        (_WORK, _WORK + "    work(4900 * random.randrange(2))\n"),
    ),
    "stalls in one of two cells, much less work in the other": (
        ("import json\n", "import json\nimport random\n"),
        (_WORK, f"    if cell == 'depot':\n    {_WORK}        time.sleep(0.03 if random.random() < 0.1 else 0.0)\n"),
    ),
    "three times the work, and answers kept from the first round": (
        ("import json\n", "import functools\nimport json\n"),
        ("def plan(", "@functools.cache\ndef plan("),
        _THRICE,
    ),
    "the first plan ten times": ((_WORK, _WORK + "    work(0 if step else 40000)\n"),),
    "half a second at start": (_before(_START, "time.sleep(0.5)\n"),),
    "half a second of work at start": (_before(_START, _SPIN.format(seconds=0.5)),),
    "half a second in an import": (("import helper\n", "import late\n"),),
    "half a second of work in an import": (("import helper\n", "import heavy\n"),),
    "half a second at the end": ((_END, "take_turn()\ntime.sleep(0.5)\ntold"),),
    "half a second between the rounds": (_before(_ROUND, "    time.sleep(0.17)\n"),),
    "100 MB more": (_before(_START, "held = bytearray(b'x') * 100_000_000\n"),),
    "a leak of 40 MB a round": (_before(_START, "held = []\n"), _before(_ROUND, "    held.append(bytearray(b'x') * 40_000_000)\n")),
    "three times the work without its cache in the home": (_before(_START, _CACHED.format(place=_HOME)), _ONLY_COLD),
    "three times the work without its cache in XDG_CACHE_HOME": (_before(_START, _CACHED.format(place=_CACHE)), _ONLY_COLD),
    "half a second of start without its cache": (_before(_START, _CACHED.format(place=_HOME) + "time.sleep(0.0 if is_warm else 0.5)\n"),),
    "hangs at start": (_before(_START, "time.sleep(1e6)\n"),),
    "hangs in a step": ((_WORK, _WORK + "    time.sleep(1e6 if step == 7 else 0.0)\n"),),
    "hangs at the end": ((_END, "take_turn()\nimport threading\nthreading.Thread(target=time.sleep, args=(1e6,)).start()\ntold"),),
    "a second process beside it": (_before(_START, _CHILD), (_END, "take_turn()\nother.kill()\nother.wait()\ntold")),
    "twice the work, half of the time told": (_TWICE, ("time.perf_counter() - began)", "0.5 * (time.perf_counter() - began))")),
    "three times the work, by a clock at a third of the speed": (
        _before(_START, "real = time.perf_counter\ntime.perf_counter = lambda: real() / 3.0\n"),
        _THRICE,
    ),
    "three times the work, and times from a list": (_THRICE, ("time.perf_counter() - began)", "1e-4 + 0.0 * began)")),
    "tells the best of thirty rounds": (
        ("ROUNDS = 3", "ROUNDS = 30"),
        ('"steps_s": [times[1:] for times in rounds]', '"steps_s": [[min(all_) for all_ in zip(*rounds)][1:]] * 3'),
    ),
    "leaves slow steps out": (
        ('"steps_s": [times[1:]', '"steps_s": [sorted(times[1:])[:50]'),
        ('"s_m": [5.0 * step for step in range(1, 1 + CELLS[cell])],', ""),
    ),
    "more iterations": (("2 * CELLS", "3 * CELLS"),),
    "no iterations told": (('{"iterations": 2 * CELLS[cell]}', "{}"),),
    "the first plan not told": (('"first_s": [times[0] for times in rounds],', ""),),
    "a crash at start": (_before(_START, "raise RuntimeError('half a commit')\n"),),
    "a crash in one process of three": (_before(_START, "import random\nif random.random() < 0.3:\n    os.abort()\n"),),
    "ends well and says nothing": (("print(", "str("),),
    "says a time that is none": (("print(json.dumps(", "print(json.dumps(told and "), ('{"cells": told}', '{"cells": {"depot": [0.0]}}')),
}  # fmt: skip
LATE, HEAVY = "import time\ntime.sleep(0.5)\n", "import time\n" + _SPIN.format(seconds=0.5)


def patched(patch: Patch) -> str:
    """Return the toy's text with its pieces replaced.

    Raises:
        ValueError: a piece does not stand there once.

    """
    text = TOY
    for old, new in patch:
        if text.count(old) < 1:
            raise ValueError(old)
        text = text.replace(old, new)
    return text


def make_repository(top: Path, files: Mapping[str, str]) -> None:
    """Make a repository of one commit."""
    top.mkdir()
    for name, text in files.items():
        (top / name).write_text(text, encoding="utf-8")
    git = ["git", "-C", str(top), "-c", "user.name=a", "-c", "user.email=a@example.org"]
    for words in (["init", "--quiet"], ["add", "."], ["commit", "--quiet", "--message", "one"]):
        subprocess.run([*git, *words], check=True)  # noqa: S603 - fixed
