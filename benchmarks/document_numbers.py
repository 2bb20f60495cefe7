"""Write the numbers of README and docs from the tables in results, or tell which ones are not those of the tables.

python benchmarks/document_numbers.py [--check]

``FIGURES`` says which sentence of which document has which numbers: ``{}`` in a sentence stands for one number, or one short text.
With --check nothing is written, and the exit code is 1 where a number differs. A sentence that is not found is an error either way.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pandas as pd

ROOT = Path(__file__).parents[1]
_MILLI = 1e3


class Figure(NamedTuple):
    """A sentence of a document, and what returns its numbers as texts."""

    document: str
    sentence: str
    numbers: Callable[[], Sequence[str]]


def table(name: str) -> pd.DataFrame:
    """Return a table of results."""
    return pd.read_csv(ROOT / "results" / name)


def paper(study: str, quantity: str) -> tuple[float, float]:
    """Return the published value of a quantity, and ours."""
    rows = table("paper/summary.csv")
    row = rows[(rows["study"] == study) & (rows["quantity"] == quantity)].iloc[0]
    return float(row["published"]), float(row["ours"])


def pairs(study: str, quantities: Sequence[str], form: str = "{:.2f}") -> list[str]:
    """Return the published values of quantities, then ours."""
    both = [paper(study, quantity) for quantity in quantities]
    return [form.format(published) for published, _ in both] + [form.format(ours) for _, ours in both]


def step(vehicle: str, scheme: str, solver: str, column: str = "fastest_mean_ms", name: str = "headline/summary.csv") -> float:
    """Return a number of a benchmark's summary."""
    rows = table(name)
    return float(rows[(rows["vehicle"] == vehicle) & (rows["scheme"] == scheme) & (rows["solver"] == solver)].iloc[0][column])


def headline(solver: str) -> list[str]:
    """Return a solver's row of the headline table [ms]."""
    texts = []
    for vehicle in ("bus", "tractor-trailer"):
        for scheme in ("rti", "sqp"):
            mean, most = (step(vehicle, scheme, solver, f"fastest_{which}_ms") for which in ("mean", "max"))
            texts += [f"{mean:.3g}", f"{most:.2g}"]
    return texts


def readme_speed() -> list[str]:
    """Return the planning step of both vehicles [ms], and how many times as long PIQP takes."""
    own, other = ([step(vehicle, "rti", solver) for vehicle in ("bus", "tractor-trailer")] for solver in ("riccati", "piqp"))
    return [f"{value:.2f}" for value in own] + [f"{piqp / riccati:.0f}" for piqp, riccati in zip(other, own, strict=True)]


def pinch() -> list[str]:
    """Return the step with a pinch [ms], riccati's and PIQP's, of the tractor-trailer and of the bus."""
    return [
        f"{step(vehicle, 'rti', solver, name='pinch/summary.csv'):.2f}"
        for vehicle in ("tractor-trailer", "bus")
        for solver in ("riccati", "piqp")
    ]


def spread(solver: str) -> list[str]:
    """Return the least and the largest factor of a solver's QP over the fastest one's, strict and at equal accuracy."""
    texts = []
    for regime in ("strict", "accuracy"):
        rows = table(f"solvers/{regime}/summary.csv")
        ratio = rows[rows["solver"] == solver]["ratio"]
        texts += [f"{ratio.min():.2g}", f"{ratio.max():.2g}" if ratio.max() < 100.0 else f"{ratio.max():.0f}"]  # noqa: PLR2004 - no exponents
    return texts


def kept(vehicle: str) -> str:
    """Return in how many of the runs of several widths a vehicle keeps all limits."""
    rows = table("widths/widths.csv")
    return str(int(((rows["vehicle"] == vehicle) & (rows["verdict"] == "kept")).sum()))


def vans(apart: float) -> list[str]:
    """Return the least and the largest factor that parked vans cost a step, this far apart [m]."""
    rows = table("obstacles/obstacles.csv")
    ratio = rows[rows["apart_m"] == apart]["ratio"]
    return [f"{ratio.min():.1f}", f"{ratio.max():.1f}"]


def balanced() -> list[str]:
    """Return by how many per cent a place's imbalance falls, for both vehicles, and the least and largest factor of a step's time."""
    gains = table("balanced/summary.csv")
    gains = gains[gains["objective"] == "balanced"]
    ratio = table("balanced/step-times.csv")["ratio"]
    return [f"{gain:.0f}" for gain in gains["gain_percent"]] + [f"{ratio.min():.1f}", f"{ratio.max():.1f}"]


def proved(vehicle: str) -> list[str]:
    """Return how many of a vehicle's NO are proved, and of how many."""
    rows = table("proof/widths.csv")
    no = rows[(rows["vehicle"] == vehicle) & (rows["fits"].astype(str) == "False")]
    return [str(int(no["kind"].notna().sum())), str(len(no))]


def proofs() -> list[str]:
    """Return of the bus how many are proved of how many, of the tractor-trailer too."""
    return proved("bus") + proved("tractor-trailer")


def contradictions() -> str:
    """Return in a word how many runs are planned within their limits and called impossible."""
    rows = table("proof/widths.csv")
    return _counted(int(((rows["fits"].astype(str) == "True") & rows["kind"].notna()).sum()))


def drawn() -> list[str]:
    """Return of the random cases how many there are, how many are called impossible, and of the narrower ones how many are, of how many."""
    rows = table("proof/random/random.csv")
    rows = rows[rows["way"].notna()]
    controls = rows["narrower_proved"].dropna().astype(str)
    return [str(len(rows)), _counted(int(rows["proof"].notna().sum())), str(int((controls == "True").sum())), str(len(controls))]


def _counted(number: int) -> str:
    return str(number) if number else "none"


def uturn_and_roundabout() -> list[str]:
    """Return of both studies ours, then the published values."""
    texts = []
    for study, quantities in (("bus-uturn", UTURN), ("roundabout", SIDES)):
        both = pairs(study, quantities)
        texts += both[2:] + both[:2]
    return texts


def liechtenstein(vehicle: str) -> list[str]:
    """Return for each width how many routes a bus can drive, and its share of their length in per cent."""
    rows = table("liechtenstein/shares.csv")
    rows = rows[rows["vehicle"] == vehicle]
    shares = 100.0 * rows["km"] / rows["of_km"]
    return [text for routes, share in zip(rows["routes"], shares, strict=True) for text in (str(routes), f"{share:.0f}")]


def extracted() -> list[str]:
    """Return the number of roads, and their length [km]."""
    first = table("liechtenstein/shares.csv").iloc[0]
    return [str(first["of_roads"]), f"{first['of_km']:.0f}"]


def narrow() -> list[str]:
    """Return how many places keep a bus out at the least and at the largest width."""
    counts = table("liechtenstein/ranking.csv")["half_width_m"].value_counts().sort_index()
    return [str(counts.iloc[0]), str(counts.iloc[-1])]


def unplanned() -> list[str]:
    """Return the number of cells that were refused, and of those without a plan."""
    ended = json.loads((ROOT / "results/liechtenstein/run.json").read_text(encoding="utf-8"))["outcomes"]
    return [str(ended["refused"]), str(ended["no plan"])]


def checked() -> list[str]:
    """Return how many cells were planned again, by how much they differ at most [m], and how many are proved."""
    rows = table("liechtenstein/checked.csv")
    apart = (rows["spare_m"] - rows["study_spare_m"]).abs().max()
    return [str(len(rows)), f"{apart:.2g}", str(int(rows["proved_from_m"].notna().sum()))]


def objectives(first: str, second: str) -> Callable[[], list[str]]:
    """Return what returns one row of the objectives' study."""
    return lambda: pairs("objectives", (first, second))


README, RESULTS, LIECHTENSTEIN = "README.md", "docs/results.md", "docs/liechtenstein.md"
UTURN, SIDES = ("proposed method, max right", "proposed method, max left"), ("max left", "max right")
FORMER = ("previous method, max right", "previous method, max left")
CONSTANT = ("tractor curvature, constant part", "articulation, constant part")
OUTSIDE = tuple(f"furthest outside, {what}" for what in ("overhang and wheelbase free", "wheelbase in the lane", "and overhangs at a cost"))
VEHICLES = ("bus", "tractor-trailer", "tractor-trailer-24m")
BUSES = {
    "citaro-k": "10.5",
    "citaro": "12.0",
    "citaro-le-u": "12.2",
    "articulated-bus": "18.1",
    "double-articulated-bus": "24",
    "rear-steered-bus": "12",
}
FIGURES = (
    Figure(README, "U-turn at {} / {} m (published {} / {}), the roundabout at {} / {} m ({} / {})", uturn_and_roundabout),
    Figure(README, "takes {} ms for the bus and {} ms for the tractor-trailer (ten roads, one QP a step), {} and {} times", readme_speed),
    Figure(README, "{} of the bus's {} `NO` and {} of the tractor-trailer's {} are proved", proofs),
    Figure(RESULTS, "previous method: right / left [m] | {} / {} | {} / {} |", lambda: pairs("bus-uturn", FORMER)),
    Figure(RESULTS, "geometric weight: right / left [m] | {} / {} | {} / {} |", lambda: pairs("bus-uturn", UTURN)),
    Figure(RESULTS, "| roundabout: left / right [m] | {} / {} | {} / {} |", lambda: pairs("roundabout", SIDES)),
    Figure(RESULTS, "curvature [1/m], articulation [rad] | {}, {} | {}, {} |", lambda: pairs("roundabout", CONSTANT, "{:.4f}")),
    Figure(RESULTS, "(J1): left / right [m] | {} / {} | {} / {} |", objectives("J1 (tractor axle), max left", "J1, max right")),
    Figure(RESULTS, "(J2): left / right [m] | {} / {} | {} / {} |", objectives("J2 (trailer axle), max left", "J2, max right")),
    Figure(RESULTS, "(J3): left / right [m] | {} / {} | {} / {} |", objectives("J3 (both axles, weighted), max left", "J3, max right")),
    Figure(RESULTS, "(J5): left / right [m] | {} / {} | {} / {} |", objectives("J5 (furthest body side), max left", "J5, max right")),
    Figure(RESULTS, "time [s] (their laptop and MATLAB) | {} | {} |", lambda: pairs("objectives", ("J5, time at 0.1 m",))),
    Figure(RESULTS, "(their road is not published) | {} / {} / {} | {} / {} / {} |", lambda: pairs("overhang", OUTSIDE)),
    Figure(
        RESULTS,
        "| kept from a hard limit [m] | {} | {} |",
        lambda: [f"{value:.1g}" for value in paper("overhang", "kept from a hard limit")],
    ),
    Figure(RESULTS, "| `riccati` | {} / {} | {} / {} | {} / {} | {} / {} |", lambda: headline("riccati")),
    Figure(RESULTS, "| `piqp` | {} / {} | {} / {} | {} / {} | {} / {} |", lambda: headline("piqp")),
    Figure(RESULTS, "without screening and active set | {} to {} | {} to {} |", lambda: spread("riccati-ipm")),
    Figure(RESULTS, "| `piqp` | {} to {} | {} to {} |", lambda: spread("piqp")),
    Figure(RESULTS, "| `hpipm` | {} to {} | {} to {} |", lambda: spread("hpipm")),
    Figure(RESULTS, "| `clarabel` | {} to {} | {} to {} |", lambda: spread("clarabel")),
    Figure(RESULTS, "riccati takes {} ms on average against PIQP's {} for the tractor-trailer", lambda: pinch()[:2]),
    Figure(RESULTS, "several programs a step, and riccati {} against {}", lambda: pinch()[2:]),
    Figure(RESULTS, "every 500 m makes the step {} to {} times as long", lambda: vans(500.0)),
    Figure(RESULTS, "one every 150 m {} to {} times", lambda: vans(150.0)),
    Figure(
        RESULTS,
        "keeps all limits in {} of 150 runs, the tractor-trailer in {}, the one of 24 m in {}.",
        lambda: [kept(vehicle) for vehicle in VEHICLES],
    ),
    Figure(RESULTS, "not kept, {} of the bus's {} are proved impossible, {} of the tractor-trailer's {} and", proofs),
    Figure(RESULTS, "and {} of {} of the one of 24 m", lambda: proved("tractor-trailer-24m")),
    Figure(RESULTS, "of the one of 24 m; {} of the kept ones is", lambda: [contradictions()]),
    Figure(RESULTS, "In {} random cases as narrow as a drive that fits, {} is called impossible", lambda: drawn()[:2]),
    Figure(RESULTS, "on either side, {} of {} are", lambda: drawn()[2:]),
    Figure(RESULTS, "falls by {} % (bus) and {} % (tractor-trailer) on average", lambda: balanced()[:2]),
    Figure(RESULTS, "for a step that takes {} to {} times as long", lambda: balanced()[2:]),
    Figure(LIECHTENSTEIN, "cuts the routes into {} roads of {} km", extracted),
    *(
        Figure(LIECHTENSTEIN, f"| `{bus}`, {long} m | {' | '.join(4 * ['{}, {}'])} |", partial(liechtenstein, bus))
        for bus, long in BUSES.items()
    ),
    Figure(LIECHTENSTEIN, "At lanes of 2.75 m, {} places keep a bus out, at 3.5 m {}. The", narrow),
    Figure(
        LIECHTENSTEIN,
        "{} of the cells were refused because the line turns on a radius below that of the bus, and {} have no plan",
        unplanned,
    ),
    Figure(
        LIECHTENSTEIN, "{} of the 16 routes are without a gap.", lambda: [str((table("liechtenstein/lines.csv")["whole"] == "yes").sum())]
    ),
    Figure(LIECHTENSTEIN, "of each bus, on {} different roads,", lambda: checked()[:1]),
    Figure(LIECHTENSTEIN, "differs from the study's by at most {} m. For {} of them", lambda: checked()[1:]),
    Figure(LIECHTENSTEIN, "[killed {} times]", lambda: [str(len(table("liechtenstein/kills.csv")))]),
)


def pattern_of(sentence: str) -> re.Pattern[str]:
    """Return what finds a sentence, wherever its lines break; every number is a group."""
    parts = [r"\s+".join(map(re.escape, part.split(" "))) for part in sentence.split("{}")]
    return re.compile(r"(\S+?)".join(parts) + (r"(?!\S)" if sentence.endswith("{}") else ""))


def renewed(text: str, figure: Figure) -> str:
    """Return a document with the numbers of a sentence as they are now.

    Raises:
        ValueError: the sentence is not in it once, or has another count of numbers.

    """
    (*found,) = pattern_of(figure.sentence).finditer(text)
    numbers = list(figure.numbers())
    if len(found) != 1 or len(found[0].groups()) != len(numbers):
        msg = f"{figure.document}: found {len(found)} times, with {len(numbers)} numbers: {figure.sentence}"
        raise ValueError(msg)
    for group in range(len(numbers), 0, -1):
        begin, end = found[0].span(group)
        text = text[:begin] + numbers[group - 1] + text[end:]
    return text


def main(arguments: Sequence[str] | None = None) -> int:
    """Renew or check all documents; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true")
    check = parser.parse_args(arguments).check
    wrong = 0
    for figure in FIGURES:
        path = ROOT / figure.document
        text = path.read_text(encoding="utf-8")
        now = renewed(text, figure)
        if now != text:
            wrong += 1
            print(f"{figure.document}: {figure.sentence.format(*figure.numbers())}")
            if not check:
                path.write_text(now, encoding="utf-8")
    return int(check and wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
