"""Write the numbers of README and docs from the tables in results, or tell which ones are not those of the tables.

python benchmarks/document_numbers.py [--check]

``FIGURES`` says which sentence of which document has which numbers: ``{}`` in a sentence stands for one number, or one short text.
With --check nothing is written, and the exit code is 1 where a number differs. A sentence that is not found is an error either way.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import document_tables as tables


class Figure(NamedTuple):
    """A sentence of a document, and what returns its numbers as texts."""

    document: str
    sentence: str
    numbers: Callable[[], Sequence[str]]


README, RESULTS, BALANCED, LIECHTENSTEIN = "README.md", "docs/results.md", "docs/balanced.md", "docs/liechtenstein.md"
NETWORKS, PROOF = "docs/networks.md", "docs/proof.md"
J3, J5 = ("J3 (both axles, weighted), max left", "J3, max right"), ("J5 (furthest body side), max left", "J5, max right")
FORMER = ("previous method, max right", "previous method, max left")
OUTSIDE = tuple(f"furthest outside, {what}" for what in ("overhang and wheelbase free", "wheelbase in the lane", "and overhangs at a cost"))
TRACKING = "docs/tracking.md"
GUARDING = "docs/guarding-timing.md"
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
    Figure(README, "of {}, {} are reproduced, {} fitted, {} explained, {} open", tables.published),
    Figure(README, "U-turn at {} / {} m (published {} / {}), the roundabout at {} / {} m ({} / {})", tables.uturn_and_roundabout),
    Figure(
        README,
        "takes {} ms for the bus and {} ms for the tractor-trailer (ten roads, no limit active). HPIPM takes {} and {} times as long, "
        "acados {} and {}, PIQP {} and {} (",
        tables.readme_speed,
    ),
    Figure(README, "a plan fits in {} of {} cases; within 2 cm less, {} of {} plans fit", tables.least_room),
    Figure(README, "{} of the bus's {} `NO` and {} of the tractor-trailer's {} are proved", tables.proofs),
    Figure(RESULTS, "previous method: furthest right / left [m] | {} / {} | {} / {} |", lambda: tables.pairs("bus-uturn", FORMER)),
    Figure(RESULTS, "geometric weight: right / left [m] | {} / {} | {} / {} |", lambda: tables.pairs("bus-uturn", tables.UTURN)),
    Figure(RESULTS, "| roundabout: left / right [m] | {} / {} | {} / {} |", lambda: tables.pairs("roundabout", tables.SIDES)),
    Figure(RESULTS, "(J3): left / right [m] | {} / {} | {} / {} |", lambda: tables.pairs("objectives", J3)),
    Figure(RESULTS, "(J5): left / right [m] | {} / {} | {} / {} |", lambda: tables.pairs("objectives", J5)),
    Figure(RESULTS, "time [s] (their laptop and MATLAB) | {} | {} |", lambda: tables.pairs("objectives", ("J5, time at 0.1 m",))),
    Figure(RESULTS, "(their road is not published) | {} / {} / {} | {} / {} / {} |", lambda: tables.pairs("overhang", OUTSIDE)),
    *(
        Figure(RESULTS, f"| `{solver}` | {{}} / {{}} | {{}} / {{}} | {{}} / {{}} | {{}} / {{}} |", partial(tables.headline, solver))
        for solver in ("riccati", *tables.COMPETITORS)
    ),
    Figure(RESULTS, "without screening and active set | {} to {} | {} to {} |", lambda: tables.spread("riccati-ipm")),
    Figure(RESULTS, "| `piqp` | {} to {} | {} to {} |", lambda: tables.spread("piqp")),
    Figure(RESULTS, "| `hpipm` | {} to {} | {} to {} |", lambda: tables.spread("hpipm")),
    Figure(RESULTS, "| `clarabel` | {} to {} | {} to {} |", lambda: tables.spread("clarabel")),
    Figure(RESULTS, "every 500 m makes the step {} to {} times as long", lambda: tables.vans(500.0)),
    Figure(RESULTS, "one every 150 m {} to {} times", lambda: tables.vans(150.0)),
    Figure(RESULTS, "SQP takes {} times as long as RTI for the bus and {} times for the tractor-trailer", lambda: tables.schemes()[:2]),
    Figure(RESULTS, "drive the same envelope to {} mm", lambda: tables.schemes()[2:]),
    Figure(RESULTS, "in {} to {} times the time of our SQP, and agrees with its optimum to {} m", tables.peers),
    *(
        Figure(
            BALANCED,
            f"**{vehicle}, balanced** | **{{}}** | **{{}} %** | {{}} % | +{{}} % | +{{}} % | x {{}} | x {{}} |",
            partial(tables.balance_row, vehicle, "balanced"),
        )
        for vehicle in VEHICLES[:2]
    ),
    Figure(BALANCED, "reach therefore differ by up to {} m", lambda: [tables.worst_imbalance()]),
    Figure(BALANCED, "falls by {} to {} % for the tractor-trailer on all ten roads", tables.trailer_gains),
    Figure(
        BALANCED,
        "for the bus by {} to {} % on eight. On `liechtenstein_planken` ({} %) and `monaco_fairmont_hairpin` ({} %)",
        tables.bus_gains,
    ),
    Figure(BALANCED, "*falls* in {} of the {} drives, and grows by {} % at most", tables.reaches),
    Figure(
        "docs/maths.md",
        "published values are {} m left and {} m right. The corrected weight gives {} m and {} m",
        lambda: tables.pairs("roundabout", tables.SIDES),
    ),
    Figure(
        "docs/maths.md",
        "weight of (1 - K) e_y + K e_trailer: {} and {} for its two vehicles, where 1 / (1 + K) is {} and {}",
        tables.weights,
    ),
    Figure(RESULTS, "by exhaustive search / by geometry | {}, {} / - | {}, {} / {}, {} |", tables.all_weights),
    Figure(RESULTS, "agrees, the size does not ({} % and {} % against {} % and {} %)", tables.gains),
    Figure(RESULTS, "{} solvers on the same recorded QPs", lambda: [tables.solvers()]),
    Figure("docs/design.md", "(IPOPT agrees to {} m wherever", lambda: tables.peers()[2:]),
    Figure(
        RESULTS,
        "keeps all limits in {} of 150 runs, the tractor-trailer in {}, the one of 24 m in {}.",
        lambda: [tables.kept(vehicle) for vehicle in VEHICLES],
    ),
    Figure(RESULTS, "not kept, {} of the bus's {} are proved impossible, {} of the tractor-trailer's {} and", tables.proofs),
    Figure(RESULTS, "and {} of {} of the one of 24 m", lambda: tables.proved("tractor-trailer-24m")),
    Figure(RESULTS, "of the one of 24 m; {} of the kept ones is", lambda: [tables.contradictions()]),
    Figure(RESULTS, "In {} random cases as narrow as a drive that fits, {} is called impossible", lambda: tables.drawn()[:2]),
    Figure(RESULTS, "on either side, {} of {} are", lambda: tables.drawn()[2:]),
    Figure(PROOF, "in the median {} m for the bus and {} m for the tractor-trailer. Tests", tables.gaps),
    Figure(PROOF, "it took {} s of processor time on average for the bus and {} s for the tractor-trailer.", tables.proof_seconds),
    Figure(LIECHTENSTEIN, "cuts the routes into {} roads of {} km", tables.extracted),
    *(
        Figure(LIECHTENSTEIN, f"| `{bus}`, {long} m | {' | '.join(4 * ['{}, {}'])} |", partial(tables.liechtenstein, bus))
        for bus, long in BUSES.items()
    ),
    Figure(LIECHTENSTEIN, "At lanes of 2.75 m, {} places keep a bus out, at 3.5 m {}. The", tables.narrow),
    Figure(LIECHTENSTEIN, "{} of the 16 routes are without a gap.", lambda: [tables.whole_routes()]),
    Figure(LIECHTENSTEIN, "of each bus, on {} different roads,", lambda: tables.checked()[:1]),
    Figure(LIECHTENSTEIN, "differs from the study's by at most {} m. For {} of them", lambda: tables.checked()[1:]),
    Figure(LIECHTENSTEIN, "[killed {} times]", lambda: [tables.kills()]),
    *(
        Figure(NETWORKS, f"| {words} | {plan} | {{}} | {{}} |", partial(tables.long_road, km, name))
        for km, words in ((100, "100 km"), (1000, "1,000 km"))
        for name, plan in (("whole", "undivided"), ("stretches", "in stretches"))
        if (km, name) != (1000, "whole")  # it was not planned
    ),
    Figure(
        TRACKING,
        "a driver who knows the plan erred by {} to {} m at an l of {} to {} m, two controllers by {} to {} m at {} to {} m.",
        tables.followers,
    ),
    Figure(TRACKING, "Of the {} widest runs, {} were within the bound for their l, and {} of these kept the street.", tables.loops_judged),
    Figure(
        GUARDING,
        "{} of {} comparisons of a toy program with itself were red, and {} of {} with dishonest and careless changes.",
        tables.gate,
    ),
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
        path = tables.ROOT / figure.document
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
