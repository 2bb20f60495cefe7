"""A million steps of exported planners: random vehicles, streets and starts; what one step took at most, and that no promise is broken.

Writes steps.csv (a row a vehicle and street), stress.md and run.json. Needs a C compiler (gcc for the stack) and, for the
instructions and for reads of memory that was never written, valgrind with its headers.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import repeat
from pathlib import Path

import numpy as np
import pandas as pd
from cases import options_of, write_results
from random_drives import edges_around, random_drive, road_around

from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.export import Budget
from hdvplan.export.write import PLANNER, exported
from hdvplan.report.grid import markdown_table
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Unit, Vehicle

PRESETS = (
    "bus", "articulated-bus", "semitrailer-active", "rigid-truck", "tractor-trailer", "semitrailer-steered", "a-double",
    "rear-steered-bus", "truck-dolly-semitrailer", "double-articulated-bus",
)  # fmt: skip
# Of a street beyond what a random drive sweeps: from one that cannot be kept to one with room.
MARGINS_M = (-0.1, 0.05, 0.2, 0.3, 0.6, 1.0, 2.0, 3.0)
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
FAST = ("-O3", "-march=native")
SANITIZED = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
WATCHED = ("-O2", "-g", "-DWATCHED")
TRAP = ("-Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc,--wrap=free",)
TRAPPED = 70  # the host's exit code where an allocator was called
FIELDS = (
    "steps", "done", "spent", "kept", "beyond", "factorisations", "most_factorisations", "most_linearisations", "worst_factorisations",
    "worst_linearisations", "broken", "deepest_m", "seconds",
)  # fmt: skip
HOST = Path(__file__).with_suffix(".c")
_TOTALS = re.compile(r"^totals: (\d+)", re.MULTILINE)


def vehicles(count: int) -> Iterator[Vehicle]:
    """Yield presets in turn, the first of each as it is, later ones with every length changed by up to a seventh."""
    for number in range(count):
        vehicle, random = load_vehicle(PRESETS[number % len(PRESETS)]), np.random.default_rng(number)
        if number >= len(PRESETS):
            units = tuple(_changed(unit, random) for unit in vehicle.units)
            vehicle = replace(vehicle, name=f"{vehicle.name}, changed {number // len(PRESETS)}", units=units)
        yield vehicle


def _changed(unit: Unit, random: np.random.Generator) -> Unit:
    names = ("wheelbase", "front_overhang", "rear_overhang", "width", "hitch_offset")
    return replace(unit, **{name: getattr(unit, name) * random.uniform(6.0 / 7.0, 8.0 / 7.0) for name in names})


def streets(vehicle: Vehicle, count: int) -> Iterator[tuple[float, Road]]:
    """Yield streets around random drives of a vehicle, with their margin [m]; what cannot be drawn as a street is left out."""
    seed = found = 0
    while found < count:
        margin, poses = MARGINS_M[found % len(MARGINS_M)], random_drive(vehicle, seed)
        seed += 1
        edges = edges_around(vehicle, poses, margin)
        if edges is None:
            continue
        try:
            road = road_around(vehicle, poses, edges)
        except HdvplanError:
            continue
        found += 1
        yield margin, replace(road, name=f"random {seed - 1}")


def compiled(folder: Path, name: str, flags: tuple[str, ...], kept: set[str]) -> Path:
    """Return the host with the planner in a folder; objects of the planner whose flags are in ``kept`` are taken as they are."""
    sources, objects = ["planner", "vehicle", *PLANNER, "simulate"], folder / name
    objects.mkdir(exist_ok=True)
    if name not in kept:
        for source in sources:
            _run(["cc", *STRICT, *flags, "-c", f"{source}.c", "-o", f"{name}/{source}.o"], folder)
        _run(["cc", "-std=c99", *flags, f"-I{folder}", "-c", str(HOST), "-o", f"{name}/host.o"], folder)
        kept.add(name)
    _run(["cc", "-std=c99", "-c", "sample.c", "-o", f"{name}/sample.o"], folder)
    listed = [f"{name}/{source}.o" for source in (*sources, "host", "sample")]
    _run(["cc", *flags, *TRAP, "-o", f"{name}/stress", *listed, "-lm"], folder)
    return objects / "stress"


def _run(words: list[str], folder: Path, codes: tuple[int, ...] = (0,)) -> str:
    """Return what a command printed.

    Raises:
        RuntimeError: it ended with another code.

    """
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603 - ours
    if done.returncode not in codes:
        msg = f"{' '.join(words[:3])} ended with {done.returncode}: {done.stderr[-800:]}"
        raise RuntimeError(msg)
    return done.stdout


def stressed(words: list[str], folder: Path, steps: int, seed: int) -> dict[str, float]:
    """Return what the host told of its steps; with 1 it tells that some broke a promise."""
    told = _run([*words, str(steps), str(seed)], folder, (0, 1))
    return {
        name: float(value) if name in {"deepest_m", "seconds"} else int(value) for name, value in zip(FIELDS, told.split(","), strict=True)
    }


def instructions(program: Path, seed: int, only: int) -> int:
    """Return the instructions of one step, counted by valgrind."""
    counter = ("valgrind", "--tool=callgrind", "--instr-atstart=no", "--callgrind-out-file=counted")
    _run([*counter, str(program), str(only + 1), str(seed), str(only)], program.parent)
    return int(_TOTALS.findall((program.parent / "counted").read_text())[-1])


def stack(folder: Path) -> int:
    """Return the deepest sum of frames from hdvplan_step on [bytes], over all calls; those through pointers may lead to any term.

    Raises:
        RuntimeError: a function calls itself, over whatever others, or its frame has no fixed size.

    """
    sources = ["planner", "vehicle", *PLANNER]
    for source in sources:
        _run(["gcc", "-std=c99", "-O2", "-fcallgraph-info=su", "-c", f"{source}.c", "-o", f"{source}.o"], folder)
    text = "\n".join((folder / f"{source}.ci").read_text() for source in sources)
    frames: dict[str, int] = {}
    for name, size, kind in re.findall(r'node: \{ title: "([^"]+)" label: "[^"]*?\\n(\d+) bytes \((\w+)\)', text):
        if kind != "static":
            msg = f"the frame of {name} is {kind}"
            raise RuntimeError(msg)
        frames[name] = int(size)
    calls: dict[str, set[str]] = defaultdict(set)
    for caller, called in re.findall(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', text):
        terms = [name for name in frames if name.startswith(("hdv_linearise_", "hdv_price_"))]
        calls[caller].update(terms if called == "__indirect_call" else [called])
    return _deepest("hdvplan_step", frames, calls, ())


def _deepest(name: str, frames: dict[str, int], calls: dict[str, set[str]], above: tuple[str, ...]) -> int:
    if name in above:
        msg = f"{name} calls itself"
        raise RuntimeError(msg)
    below = (_deepest(called, frames, calls, (*above, name)) for called in calls[name])
    return frames.get(name, 0) + max(below, default=0)


def looked_at(folder: Path, steps: int, seed: int, worst: int, kept: set[str]) -> dict[str, object]:
    """Return how many steps ran under valgrind and the sanitizers; on the first street also the worst one's instructions, and the stack."""
    watched, sanitized = compiled(folder, "watched", WATCHED, kept), compiled(folder, "sanitized", SANITIZED, kept)
    found: dict[str, object] = {
        "under_valgrind": stressed(["valgrind", "--error-exitcode=9", "--quiet", str(watched)], folder, steps, seed)["steps"],
        "under_sanitizers": stressed([str(sanitized)], folder, steps, seed)["steps"],
    }
    return found | {"instructions": instructions(watched, seed, worst), "stack_bytes": stack(folder)} if seed == 0 else found


def rows_of(vehicle: Vehicle, count: int, steps: int, checked: int) -> list[tuple[Case, dict[str, object]]]:
    """Return cases with what steps on each of a vehicle's streets took, so many of them ``checked``; the first one is counted, too."""
    found: list[tuple[Case, dict[str, object]]] = []
    with tempfile.TemporaryDirectory() as made:
        folder, kept, planner = Path(made), set[str](), ""
        for number, (margin, road) in enumerate(streets(vehicle, count)):
            case = Case(road, vehicle)
            files = exported(case, Budget())
            own = files["vehicle.c"] + files["vehicle.h"]
            kept = kept if own == planner else set()
            planner = own
            for name, text in files.items():
                (folder / name).write_text(text, encoding="utf-8")
            fast = compiled(folder, "fast", FAST, kept)
            row: dict[str, object] = {"vehicle": vehicle.name, "units": len(vehicle.units), "street": road.name, "margin_m": margin}
            row |= (took := stressed([str(fast)], folder, steps, number))
            if checked:
                _run([str(fast), "1", "0", "-2"], folder, (TRAPPED,))  # the trap springs
                row |= looked_at(folder, checked, number, int(took["worst_factorisations"]), kept)
            print(row, file=sys.stderr)
            found.append((case, row))
    return found


def text(rows: pd.DataFrame) -> str:
    """Return the page."""
    count = rows[["steps", "done", "spent", "kept", "beyond", "broken"]].sum()
    rows = rows.reindex(columns=list(dict.fromkeys([*rows, "under_valgrind", "under_sanitizers", "instructions", "stack_bytes"])))
    by = rows.groupby("units", sort=True)
    table = by[["most_factorisations", "most_linearisations", "instructions", "stack_bytes", "deepest_m"]].max()
    table = by[["steps", "spent", "kept", "beyond"]].sum().join(table).reset_index()
    for name in ("instructions", "stack_bytes"):
        table[name] = [f"{value:.0f}" if value == value else "" for value in table[name]]  # noqa: PLR0124 - NaN: not looked at
    each = (rows["seconds"].sum() / rows["steps"].sum()) * 1e6
    return (
        f"{count['steps']} steps of {rows['vehicle'].nunique()} vehicles on {len(rows)} random streets, some of which cannot be kept, from "
        f"random starts, with disturbances: {count['done']} ended with all programs solved, {count['spent']} with the budget spent, "
        f"{count['kept']} with a program that could not be solved, {count['beyond']} outside the model. {count['broken']} broke a promise: "
        "a count beyond the budget, a number of the plan that is not finite, or steering that the vehicle cannot do. No step called an "
        f"allocator. {int(rows['under_valgrind'].sum())} steps ran under valgrind and {int(rows['under_sanitizers'].sum())} under the "
        f"sanitizers for addresses and undefined behaviour, without a report. A step took {each:.0f} us of processor time in the mean "
        f"(`{' '.join(FAST)}`).\n\n"
        "The most of one step, by bodies of the vehicle; instructions are those of the step with the most factorisations on the narrowest "
        "street, the stack is the sum of frames along the deepest calls (`-O2`, without `math.h`):\n\n"
        f"{markdown_table(table, text=('instructions', 'stack_bytes'))}\n"
    )


def main() -> None:
    """Measure and write."""
    parser = options_of(__doc__, "export-stress")
    parser.add_argument("--vehicles", type=int, default=20)
    parser.add_argument("--streets", type=int, default=8)
    parser.add_argument("--steps", type=int, default=6250, help="of each vehicle on each street")
    parser.add_argument("--looked", type=int, default=10, help="how many vehicles are looked at under valgrind and the sanitizers")
    parser.add_argument("--checked", type=int, default=125, help="steps of each of these on each street, under either")
    parser.add_argument("--jobs", type=int, default=1, help="vehicles at a time")
    given = parser.parse_args()
    checked = [given.checked * (number < given.looked) for number in range(given.vehicles)]
    found: list[tuple[Case, dict[str, object]]] = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for made in pool.map(rows_of, vehicles(given.vehicles), repeat(given.streets), repeat(given.steps), checked):
            found += made  # it runs for hours: every vehicle is written as it comes
            rows = pd.DataFrame([row for _, row in found])
            write_results(given.out, {"steps": rows}, {"stress": text(rows)}, [case for case, _ in found], form=None)
    if broken := int(rows["broken"].sum()):
        sys.exit(f"{broken} steps broke a promise; {given.out / 'steps.csv'} has the vehicles and streets")


if __name__ == "__main__":
    main()
