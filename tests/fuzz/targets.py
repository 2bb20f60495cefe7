"""What is fuzzed: commands that read one damaged file, and what they must do then: answer, or refuse it in a line, in bounded time."""

from __future__ import annotations

import io
import json
import math
import shutil
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import chdir, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hdvplan.cli.app import run
from tests.fuzz import seeds

LIMIT_S = 90.0  # of CPU time, for one file of some kilobytes
_CODES = {0, 1, 2, 3}
_QUIET = ("--no-plot", "--no-proof", "--quiet", "--out", "out")


@dataclass(frozen=True)
class Target:
    """A file that is damaged, and the command that reads it, in a folder that has all that the command needs."""

    name: str
    path: Path
    command: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """How a command ended: ``fault`` says what it must not do, "" where it did none of it; ``planned`` whether it answered.

    ``trace`` is what the same command said with --debug where it had ended in exit code 70.
    """

    code: int
    error: str
    seconds: float
    planned: bool
    fault: str
    trace: str = ""


def make_targets(folder: Path) -> list[Target]:
    """Write the seeds into a folder, make a plan and a benchmark there, and return all that can be fuzzed."""
    targets = []
    for name, text in seeds.road_texts().items():
        (folder / name).write_text(text, encoding="utf-8")
        targets.append(_road(folder / name))
    targets += [_road(path) for path in seeds.write_binary(folder)]
    for name, text in (("truck.toml", seeds.VEHICLE), ("suite.toml", seeds.SUITE), ("bias.csv", seeds.BIAS)):
        (folder / name).write_text(text, encoding="utf-8")
    targets.append(Target("truck.toml", folder / "truck.toml", ("plan", "uturn", "--vehicle", "truck.toml", *_QUIET)))
    targets.append(Target("bias.csv", folder / "bias.csv", ("plan", "plain.csv", "--vehicle", "bus", "--bias", "bias.csv", *_QUIET)))
    with chdir(folder):
        run(["plan", "obstacles.geojson", "--vehicle", "bus", "--no-plot", "--no-proof", "--quiet", "--out", "plan"])
        run(["bench", "--suite", "suite.toml", "--out", "run", "--quiet"])
        shutil.copytree("run", "base")
    report, compare = ("report", "plan", "--out", "page.html", "--quiet"), ("compare", "base", "run")
    targets += [Target(f"plan/{file.name}", file, report) for file in sorted((folder / "plan").iterdir()) if file.name != "run.json"]
    targets += [
        Target(f"run/{name}", folder / "run" / name, compare) for name in ("run.json", "samples.csv.gz", "timing.csv", "envelope.csv")
    ]
    return targets


def tried(target: Target, content: bytes) -> Outcome:
    """Give a command a damaged file, and judge what it does."""
    folder = target.path.parents[1] if target.path.parent.name in {"plan", "run"} else target.path.parent
    before = target.path.read_bytes()
    target.path.write_bytes(content)
    shutil.rmtree(folder / "out", ignore_errors=True)
    began, trace = time.process_time(), ""
    try:
        code, out, err = _ran(target.command, folder)
        seconds = time.process_time() - began
        if code not in _CODES:
            again, _, said = _ran(("--debug", *target.command), folder)
            trace = f"again, with --debug: exit {again}\n{said}"
    finally:
        target.path.write_bytes(before)
    summary = folder / "out" / "summary.json"
    planned = summary.is_file() if target.command[0] == "plan" else code in {0, 1}
    errors = [line for line in err.splitlines() if line.startswith("error: ")]
    fault = _fault(code, errors, out + err, seconds)
    if not fault and target.command[0] == "plan" and planned:
        fault = _nonsense(summary, code)
    return Outcome(code, errors[0] if errors else "", seconds, planned, fault, trace)


def _ran(command: Sequence[str], folder: Path) -> tuple[int, str, str]:
    """Run a command in a folder; return its exit code, and what it wrote to stdout and stderr."""
    out, err = io.StringIO(), io.StringIO()
    with chdir(folder), redirect_stdout(out), redirect_stderr(err), warnings_raised():
        code = run(list(command))
    return code, out.getvalue(), err.getvalue()


@contextmanager
def warnings_raised() -> Iterator[None]:
    """Make errors of warnings in the block, as pytest does: each would be a line on stderr that says nothing to users."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "The 'generic' unit for NumPy timedelta", DeprecationWarning)  # as in pyproject.toml
        yield


def _road(path: Path) -> Target:
    return Target(path.name, path, ("plan", path.name, "--vehicle", "bus", *seeds.road_options(path.name), *_QUIET))


def _fault(code: int, errors: list[str], said: str, seconds: float) -> str:
    tests: dict[str, Callable[[], bool]] = {
        f"exit {code}": lambda: code not in _CODES,
        "a traceback": lambda: "Traceback" in said,
        f"{len(errors)} errors with exit {code}": lambda: len(errors) != (code == 2) and not (code in {1, 3} and len(errors) <= 1),
        "control signs": lambda: any(not (sign.isprintable() or sign == "\n") for sign in said),
        f"{seconds:.0f} s": lambda: seconds > LIMIT_S,
    }
    return next((name for name, holds in tests.items() if holds()), "")


def _nonsense(summary: Path, code: int) -> str:
    """Return what is impossible in an answer."""
    told = json.loads(summary.read_text(encoding="utf-8"))
    return next((found for part in told.get("legs", [told]) if (found := _nonsense_in(part, code, 1.0 if "legs" in told else 5.0))), "")


def _nonsense_in(told: dict[str, Any], code: int, shortest: float) -> str:
    numbers = [told[key] for key in ("length_m", "max_left_m", "max_right_m", "mean_abs_imbalance_m")]
    if not all(isinstance(number, int | float) and math.isfinite(number) for number in numbers):
        return "numbers that are none"
    if not shortest <= numbers[0] <= 200e3:
        return f"a road of {numbers[0]} m"
    if code == 0 and told["limit_violation_m"] > 0.011:
        return f"exit 0 with limits broken by {told['limit_violation_m']} m"
    return ""
