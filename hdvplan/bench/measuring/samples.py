"""One drive's measurement: how it ended, what is kept of it, on disk until the whole benchmark is done, and then in tables."""

from __future__ import annotations

import gzip
import json
import zlib
from dataclasses import dataclass, field, fields
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING
from zipfile import BadZipFile

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from hdvplan.arrays import FloatArray
from hdvplan.errors import HdvplanError, OptionError
from hdvplan.fileio import json_bytes, refuse_endless, write_atomically

if TYPE_CHECKING:  # tables of times can be read where nothing can be planned
    from hdvplan.planning.planner import Plan

OK, FAILED, OVER_BUDGET = "ok", "failed", "over budget"
UNRECORDED = "nothing recorded"  # of a sample: the reference cannot drive the course, whatever the solver
UNFAIR = "unfair"  # right or not: it waits, changes clocks or remembers answers
CRASHED, HUNG, OUT_OF_MEMORY = "crashed", "out of time", "out of memory"
WRONG, WRONG_PATH = "wrong optimum", "wrong path"
LOST = frozenset({FAILED, CRASHED, HUNG, OUT_OF_MEMORY, WRONG, WRONG_PATH})  # no plan that is right, which is no matter of a budget
_LARGEST = 1_000_000_000  # bytes of an unpacked table: ten million planning steps

NUMBERS = (
    "linearise_s", "update_s", "solve_s", "check_s", "total_s", "qp_count", "iterations", "usable",
    "primal", "dual", "gap", "violation_m", "aside_s", "cpu_s", "binding",
    "cold_s", "s_m", "outer_s", "waits",
)  # fmt: skip
COUNTS = ("qp_count", "iterations")
_WORDS = ("statuses", "outcome", "message", "nonzeros", "first_step")  # of a measurement, beside its tables
DISTANCES = ("distance_m", "distance_u", "scale")  # see ``ReferenceCheck.take``


@dataclass(frozen=True)
class Judgement:
    """What the executed drive swept, over all of the road; see ``Balance``. Lengths in metres."""

    max_left: float
    max_right: float
    mean_abs_imbalance: float
    expected_half_width: float
    min_clearance: float  # NaN without limits
    violation: float
    e_y: FloatArray  # (stations,) executed lateral error
    left: FloatArray  # (n,) signed reach over s
    right: FloatArray  # (n,)


@dataclass(frozen=True)
class Measurement:
    """One drive of one cell: every planning step, how the drive ended, and, where it reached the end, what it swept."""

    steps: FloatArray  # (steps, len(NUMBERS)), times in seconds
    statuses: tuple[str, ...]  # the solver's status of every step's last QP
    outcome: str  # OK, FAILED, UNFAIR, UNRECORDED, OVER_BUDGET, CRASHED, HUNG or OUT_OF_MEMORY
    message: str
    nonzeros: int  # of the QP's Hessian (upper triangle), dynamics and rows
    judgement: Judgement | None
    distances: FloatArray = field(default_factory=lambda: np.empty((0, len(DISTANCES))))  # (judged steps, len(DISTANCES)), of judged drives
    first_step: int = 0  # the number of the first step; 1 where there is no first plan made from nothing

    def table(self) -> pd.DataFrame:
        """Return the steps, one row each: step, times [s], counters, status, residuals."""
        table = pd.DataFrame(self.steps, columns=list(NUMBERS))
        table = table.astype(dict.fromkeys(COUNTS, int) | {"usable": bool, "binding": bool})
        table.insert(0, "step", self.first_step + np.arange(len(table)))
        table.insert(NUMBERS.index("usable") + 1, "status", pd.Series(self.statuses, dtype=object))
        for name, values in zip(DISTANCES, self.distances.T, strict=True):
            table[name] = pd.Series(values).reindex(table.index)
        return table


def outcome_of(error: Exception) -> tuple[str, str]:
    """Return how a drive ended that raised, and why in words."""
    words = " ".join(str(error).split())
    if isinstance(error, MemoryError):
        return OUT_OF_MEMORY, words or "an allocation was refused"
    return FAILED, words if isinstance(error, HdvplanError) else f"{type(error).__name__}: {words}"


def ended(outcome: str, message: str) -> Measurement:
    """Return the measurement of a drive of which nothing is left but how it ended."""
    return Measurement(np.empty((0, len(NUMBERS))), (), outcome, message, 0, None)


def numbers_of(plan: Plan, s_m: float, outer_s: float, waits: int) -> list[float]:
    """Return the numbers of one planning step in the order of a measurement's ``steps``; it begins at ``s_m``.

    ``outer_s`` is what the step took by the clock of whoever drives: executing the last plan, and all that surrounds planning, included.
    ``waits`` is how often its thread gave the core away meanwhile.
    """
    times = plan.times
    named = {
        "linearise_s": times.linearise, "update_s": times.update, "solve_s": times.solve, "check_s": times.check, "total_s": times.total,
        "qp_count": plan.qp_count, "iterations": plan.qp_iterations, "usable": plan.usable, **plan.residuals._asdict(),
        "violation_m": plan.violation, "aside_s": times.aside, "cpu_s": times.cpu, "binding": plan.merit is not None, "cold_s": np.nan,
        "s_m": s_m, "outer_s": outer_s, "waits": waits,
    }  # fmt: skip
    return [float(named[name]) for name in NUMBERS]


def part_file(directory: Path, cell: int, round_: int) -> Path:
    """Return where one drive's measurement is kept until the benchmark is complete."""
    return directory / "parts" / f"{cell:05d}.{round_}.npz"


def write_part(path: Path, measured: Measurement) -> None:
    """Keep a measurement: the file appears whole or not at all.

    Raises:
        OSError: the file cannot be written.

    """
    words = {name: getattr(measured, name) for name in _WORDS}
    arrays: dict[str, NDArray[np.generic]]
    arrays = {"words": np.frombuffer(json_bytes(words), np.uint8), "steps": measured.steps, "distances": measured.distances}
    arrays |= {name: np.asarray(value) for name, value in vars(measured.judgement).items()} if measured.judgement else {}
    buffer = BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, buffer.getvalue())


def read_part(path: Path) -> Measurement:
    """Return a kept measurement.

    Raises:
        OptionError: it is damaged, such as by a crash of the machine.

    """
    try:
        return _read_part(path)
    except (OSError, EOFError, LookupError, NotImplementedError, TypeError, ValueError, BadZipFile, zlib.error) as error:
        msg = f"{path} cannot be read: {error}"
        raise OptionError(msg, hint="delete it: the same command measures it again") from error


def _read_part(path: Path) -> Measurement:
    with path.open("rb") as file, np.load(file) as arrays:  # NumPy leaves a file open that it cannot read
        words = json.loads(arrays["words"].tobytes())
        judged = Judgement(**{one.name: arrays[one.name][()] for one in fields(Judgement)}) if "e_y" in arrays else None
        words["statuses"] = tuple(words["statuses"])
        return Measurement(steps=arrays["steps"], judgement=judged, distances=arrays["distances"], **{name: words[name] for name in _WORDS})


def read_plain(path: Path) -> pd.DataFrame:
    """Return a table that was written as CSV, packed by gzip or not.

    Raises:
        OSError: it cannot be read, or is too large.
        EOFError: it is cut off.
        ValueError: it is no table, or unpacks to too much.
        zlib.error: it is damaged.

    """
    refuse_endless(path)
    if path.suffix != ".gz":
        return pd.read_csv(path)
    with gzip.open(path) as file:
        content = file.read(_LARGEST + 1)  # a megabyte can be a gigabyte of nothing
    if len(content) > _LARGEST:
        msg = f"it unpacks to more than {_LARGEST / 1e6:.0f} MB"
        raise ValueError(msg)
    return pd.read_csv(BytesIO(content))
