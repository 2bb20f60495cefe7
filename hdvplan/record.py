"""``run.json``: what a folder of results was made from and with. Every command and script that writes results writes one."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from hdvplan.case import Case, Json
from hdvplan.fileio import json_bytes, write_atomically
from hdvplan.machine import commit, machine_facts, software

NAME = "run.json"


def write_record(directory: Path, cases: Iterable[Case], part: str = "") -> None:
    """Write ``run.json``: the cases, hdvplan's commit and source, versions, machine, command and date.

    Of one ``part`` of what ``directory`` holds it is ``<part>-run.json``.

    Raises:
        OSError: the file cannot be written.

    """
    write_atomically(directory / (f"{part}-{NAME}" if part else NAME), json_bytes(record_of(cases)))


def record_of(cases: Iterable[Case]) -> Json:
    """Return what ``run.json`` says: of a single case everything, of several their names, keys and what is not usual."""
    once = list(dict.fromkeys(cases))
    return {
        "cases": [once[0].described()] if len(once) == 1 else [case.brief() for case in once],
        "command": command(),
        "date": now(),
        "commit": commit(),
        "software": software(
            tuple(dict.fromkeys(case.solver_name for case in once)), tuple(dict.fromkeys(case.objective_name for case in once))
        ),
        "machine": machine_facts(),
    }


def command() -> list[str]:
    """Return the command line that started this process, without the place where the program is installed."""
    program = Path(sys.argv[0])
    return ["hdvplan" if program.stem in {"hdvplan", "__main__"} else program.name, *sys.argv[1:]]


def now() -> str:
    """Return the present time, UTC, in ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="seconds")
