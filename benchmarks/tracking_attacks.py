"""Drivers who err as much as the answer allows, 10,000 a vehicle, integrated apart: touches. Writes attacks.csv, attacks.md and run.json.

python benchmarks/tracking_attacks.py [--out results/tracking-attacks] [--vehicles a,b] [--attacks 10000]
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pandas as pd
from cases import options_of, words, write_results

from hdvplan.api import plan
from hdvplan.arrays import FloatArray, Records
from hdvplan.judging.straying import SPACING_M, Chain, Tracked, chain_of
from hdvplan.judging.tracking import tracking_of
from hdvplan.report.grid import markdown_table
from tests.tracking.attacks import Motion, strayed
from tests.tracking.scenes import Scene, along, case_of
from tests.tracking.test_bound import weights, worst
from tests.tracking.test_kerbs import aims, led, touching

HALF_WIDTHS_M = {"a-double": 4.2, "semitrailer-steered": 2.6, "articulated-bus": 3.1, "tractor-trailer": 3.3, "bus": 3.0}
LENGTH_M = 6.0  # of tracking
BATCH = 500  # attacks in memory
PROCESSES = 2
KINDS = ("random walks", "bang-bang", "waves", "the worst, moved")
TOLD_M = (0.1, 0.3)  # errors with which the bound is held against the worst that is found, where E is decided
HAT_M, HATS = 1.0, 120  # width of the hats by which an optimiser changes an error, and how many there are one behind the other
ROUNDS, STEPS, NUDGE, CLOSE_M = 8, 21, 0.05, 1e-5  # its rounds at most, steps of each, share of E to feel with, and what ends it


def main() -> None:
    """Attack a plan of every vehicle and write the table."""
    parser = options_of(__doc__, "tracking-attacks")
    parser.add_argument("--vehicles", type=words, default=list(HALF_WIDTHS_M))
    parser.add_argument("--attacks", type=int, default=10_000)
    options = parser.parse_args()
    with ProcessPoolExecutor(PROCESSES) as pool:
        table = pd.DataFrame(pool.map(attacked, options.vehicles, [options.attacks] * len(options.vehicles)))
    cases = [case_of(scene_of(vehicle)) for vehicle in options.vehicles]
    write_results(options.out, {"attacks": table}, {"attacks": markdown(table)}, cases)


def scene_of(vehicle: str) -> Scene:
    """Return the bend that a vehicle drives, between kerbs."""
    return along(vehicle, HALF_WIDTHS_M[vehicle])


def attacked(vehicle: str, attacks: int) -> dict[str, object]:
    """Attack the plan of one vehicle; return its row."""
    scene = scene_of(vehicle)
    result = plan(case_of(scene))
    tracking, chain = tracking_of(result.drive, result.balance, LENGTH_M), chain_of(result.drive)
    error = 0.0 if tracking is None else tracking.error
    made, rng = Tracked(chain.vehicle.table(), chain.links, LENGTH_M), np.random.default_rng(11)
    aimed = aims(result, chain, 1.05 * error)
    made.err(error)
    made.follow(aimed["at"])
    touches, batches = 0, -(-attacks // BATCH)
    for number in range(batches):
        kind = KINDS[number % len(KINDS)]
        motion = led(chain, lambda half_steps, kind=kind: error * errors(made, aimed, half_steps, kind, rng))  # type: ignore[misc] # Callable
        touches += touching(scene, chain, motion, aimed)
    row: dict[str, object] = {"vehicle": vehicle, "half_width_m": HALF_WIDTHS_M[vehicle], "spare_m": result.balance.min_clearance}
    row |= {"error_m": error, "decided": tracking is not None and tracking.decided, "attacks": BATCH * batches + 1}
    decides = aimed[:1]
    decides["gap"] = 0.0  # all of the bound counts, whether it closes the gap or not
    for name, one in {"": error, **{f"_{one:g}_m": one for one in TOLD_M}}.items():
        made.err(one)
        motion = optimised(chain, made, decides, one)
        gain, remainder = made.approaches(decides)[:, 0]
        row |= {f"first_order{name}": one * gain, f"bound{name}": one * gain + remainder}
        row |= {f"worst{name}": float(came_near(chain, motion, decides[0])[1])}
        touches += touching(scene, chain, motion, aimed) if one == error else 0
    row["touches"] = touches
    print(*row.values(), sep="  ", flush=True)
    return row


def optimised(chain: Chain, made: Tracked, brush: Records, error: float) -> Motion:
    """Return the motion with the errors that bring a body nearest to one place.

    A conditional gradient from the first order's worst case on: the best errors for the gradient, then the best of all between.
    """
    place = float(brush["at"][0])
    nodes = place - SPACING_M * np.arange(int(HAT_M * HATS / SPACING_M))
    hats = np.maximum(0.0, 1.0 - np.abs(nodes - place + HAT_M * np.arange(HATS)[:, None]) / HAT_M)

    def moved(several: FloatArray) -> Motion:
        return led(chain, lambda half_steps: error * np.array([np.interp(half_steps, nodes[::-1], one[::-1]) for one in several]))

    first = worst(weights(made, brush), made.levels)[1]
    now, near = np.append(first, np.full(len(nodes), first[-1]))[: len(nodes)], -np.inf
    for _ in range(ROUNDS):
        felt = came_near(chain, moved(np.concatenate([now[None], now + NUDGE * hats])), brush[0])
        gradient = (felt[2:] - felt[1]) / NUDGE @ hats * SPACING_M / HAT_M
        between = now + np.linspace(0.0, 1.0, STEPS)[:, None] * (worst(gradient, made.levels)[1] - now)
        found = came_near(chain, moved(between), brush[0])[1:]
        now, before, near = between[int(np.argmax(found))], near, float(np.max(found))
        if near < before + CLOSE_M:
            break
    return moved(now[None])


def errors(made: Tracked, aimed: Records, half_steps: FloatArray, kind: str, rng: np.random.Generator) -> FloatArray:
    """Return errors (BATCH, n) of one kind, between -1 and 1, that change by 1 within the tracking length at least."""
    each = half_steps[1] - half_steps[0]
    if kind == "waves":  # from those that only the lead unit answers to, to those that the last trailer follows
        slope, phase = 2.0 * np.pi / np.exp(rng.uniform(np.log(8.0), np.log(120.0), BATCH)), rng.uniform(0.0, 2.0 * np.pi, BATCH)
        most = np.minimum(1.0, 1.0 / (made.length * slope))
        return most[:, None] * np.sin(slope[:, None] * half_steps + phase[:, None])
    if kind == "the worst, moved":  # what a search around the first order's worst would try
        found = np.zeros((BATCH, len(half_steps)))
        every = [worst(weights(made, brush[None]), made.levels)[1] for brush in aimed]
        for number in range(BATCH):
            brush, of = aimed[number % len(aimed)], every[number % len(aimed)]
            nodes = brush["at"] - SPACING_M * np.arange(len(of)) + (0.0 if number < len(aimed) else rng.normal(0.0, 1.0))
            found[number] = np.interp(half_steps, nodes[::-1], of[::-1])
        return found
    held = rng.integers(1, 150, BATCH)
    found, now, step = np.empty((BATCH, len(half_steps))), rng.uniform(-1.0, 1.0, BATCH), np.ones(BATCH)
    for at in range(len(half_steps)):
        fresh = rng.choice([-1.0, 1.0], BATCH) if kind == "bang-bang" else rng.uniform(-1.0, 1.0, BATCH)
        step = np.where(at % held == 0, fresh, step)
        now = np.clip(now + step * each / made.length, -1.0, 1.0)
        found[:, at] = now
    return found


def came_near(chain: Chain, motion: Motion, brush: np.void) -> FloatArray:
    """Return how near attacks, and before them the plan, came at a brush (1 + attacks,) [m], along its own direction."""
    planned, posed = Motion(motion.front, motion.axles[:, :1], motion.headings[:, :1]), chain.closely()
    unit, at = int(brush["unit"]), float(brush["at"])
    moved, turned = strayed(planned, motion, unit, at)
    track = posed.poses[int(np.searchsorted(posed.front, at))][unit]
    off = float(chain.links[int(at / SPACING_M), unit]["axle_off"])
    left = np.array([-track["sin"] * np.cos(off) - track["cos"] * np.sin(off), track["cos"] * np.cos(off) - track["sin"] * np.sin(off)])
    near: FloatArray = brush["by_axle"] * (moved @ left) + brush["by_heading"] * np.sin(turned) - brush["second"] * (1.0 - np.cos(turned))
    return near


def markdown(table: pd.DataFrame) -> str:
    """Return the table as it is read."""
    shown = table[["vehicle", "half_width_m", "spare_m", "error_m", "decided", "attacks", "touches"]].copy()
    shown["spare_m"], shown["error_m"] = table["spare_m"].map("{:.2f}".format), table["error_m"].map("{:.3f}".format)
    names = ["vehicle", "half width [m]", "spare [m]", "E [m]", "a place decides", "attacks", "touches"]
    for name, words_ in {"": "E", **{f"_{one:g}_m": f"{one:g} m" for one in TOLD_M}}.items():
        for what in ("first_order", "bound"):
            quotient = table[f"{what}{name}"] / table[f"worst{name}"]
            shown[what + name] = quotient.where(np.isfinite(table[f"bound{name}"])).map("{:.2f}".format, na_action="ignore").fillna("none")
            names.append(f"{what.replace('_', ' ')} / worst, {words_}")
    shown.columns = names
    return f"""# Attacks on what a driver may err by

Drives of a bend of 14 m with errors up to E, integrated apart from the program: {", ".join(KINDS)}, as many of each, and what an optimiser
finds. A touch is a body beyond a kerb by more than 0.1 mm, at poses every 0.1 m around the places that are aimed at. How near a
body may come where E is decided, by the bound and by its part of first order, is told over the worst that the optimiser finds: with E, and
with other errors.

{markdown_table(shown, text=("vehicle",))}
"""


if __name__ == "__main__":
    main()
