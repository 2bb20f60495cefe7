"""What balancing the measured envelope gains over the stationary weight, and what it costs: S-turns, convergence, real roads.

Writes its tables (csv, md), figures and run.json into results/balanced. All numbers are of the exact simulation of the executed motion.
"""

from __future__ import annotations

import argparse
import gc
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d

from hdvplan.api import drive_case, prepare
from hdvplan.bench.courses import with_limits
from hdvplan.bench.suite import ROADS, Suite
from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.fileio import csv_bytes, write_atomically
from hdvplan.jit import FloatArray
from hdvplan.judging.envelope import envelope_of
from hdvplan.machine import use_one_thread
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import Goal, Objective, balanced, geometric
from hdvplan.planning.planner import Plan
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.balance import BalancePart, EnvelopeBalance
from hdvplan.planning.terms.centring import Centring, CentringPart, Residual
from hdvplan.planning.terms.term import Horizon, Needs, Place, Scene
from hdvplan.record import write_record
from hdvplan.report.markdown import markdown_table
from hdvplan.reproduce.swept import Swept, road_of, swept, whole_manoeuvre
from hdvplan.road.load import load_road
from hdvplan.road.road import Road
from hdvplan.road.scenarios import sturn_profile
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

VEHICLES = ("bus", "tractor-trailer")
CURVATURES = (0.03, 0.045, 0.06, 0.08)  # [1/m]
SHARPNESSES = (0.005, 0.01, 0.02)  # [1/m^2]
EXAMPLE = (0.06, 0.01)
FINE = {"sharpness", "mean_abs_imbalance_m", "geometric_m", "balanced_m"}  # columns that need a tenth of a millimetre
WORDS = {"vehicle", "objective", "rule", "road", "limits"}  # columns that hold no numbers
ROUNDS = (1, 2, 3, 4, 6, 8, 10, 15, 20, 30, 50)
TIMED_ROUNDS = 8  # every step counts with the fastest: a busy machine only ever adds time
RTI, SQP = PlannerSettings(), PlannerSettings(scheme=Scheme.SQP)

# The deferred correction that the method replaces: K e_y + e_aux - c(s), c lowered by a share of the low-passed imbalance.
CRUDE_GAIN = 0.35
CRUDE_LOW_PASS_M = 2.0


def balanced_with(**changes: float) -> Objective:
    """Return the objective with other values in the place of its defaults."""
    return partial(_changed, changes)


def _changed(changes: Mapping[str, float], stations: Stations, vehicle: Vehicle) -> Goal:
    goal, of_term = balanced(stations, vehicle), {name: value for name, value in changes.items() if name != "rounds"}
    term = replace(_balance_of(goal), **of_term)  # type: ignore[arg-type] # names of fields that are numbers
    return Goal((term,), int(changes["rounds"]) if "rounds" in changes else goal.rounds)


def _balance_of(goal: Goal) -> EnvelopeBalance:
    (term,) = (term for term in goal.terms if isinstance(term, EnvelopeBalance))
    return term


def _residual_of(goal: Goal) -> Residual:
    (term,) = (term for term in goal.terms if isinstance(term, Centring))
    return term.residual


def case_of(road: Road, vehicle: Vehicle, objective: Objective, settings: PlannerSettings) -> Case:
    """Return a run by an objective that need not have a name that users know."""
    if not isinstance(objective, partial):
        return Case(road, vehicle, getattr(objective, "__name__", "unnamed"), settings=settings)
    changes = ", ".join(f"{name}={value:g}" for name, value in objective.args[0].items())
    return Case(road, vehicle, f"balanced: {changes}", settings=settings)


def run(road: Road, vehicle: Vehicle, objective: Objective, settings: PlannerSettings, driven: list[Case]) -> Swept:
    """Drive and measure; what was driven is added to ``driven``."""
    driven.append(case_of(road, vehicle, objective, settings))
    return swept(driven[-1], objective)


def case_road(curvature: float, sharpness: float) -> Road:
    """Return one S-turn of the family."""
    return road_of("sturn", sturn_profile(curvature, sharpness))


def numbers(found: Swept) -> dict[str, float]:
    """Return what a drive is judged by; lengths in metres."""
    kappa, imbalance = found.drive.kappa, np.abs(found.left - found.right)
    return {
        "mean_abs_imbalance_m": float(np.mean(imbalance)),
        "max_abs_imbalance_m": float(np.max(imbalance)),
        "furthest_m": found.furthest,
        "sum_squared_changes": float(np.sum(np.diff(kappa) ** 2)),
        "max_kappa_per_m": float(np.max(np.abs(kappa))),
        "programs": float(np.mean([plan.qp_count for plan in found.drive.plans[1:]] or [1])),
    }


class Deferred:
    """The crude rule in receding horizon: a term like centring, whose target c every plan corrects for the next ones."""

    def __init__(self, vehicle: Vehicle, settings: PlannerSettings) -> None:
        self._settings = settings
        self._middle = round(0.5 * (vehicle.reach_ahead - vehicle.reach_behind) / settings.step)

    def objective(self, stations: Stations, vehicle: Vehicle) -> Goal:
        """Return the geometric residual with a target that ``correct`` changes."""
        self._residual = _residual_of(geometric(stations, vehicle))
        measured = Goal((replace(_balance_of(balanced(stations, vehicle)), ahead=np.inf),))
        self._measured, (self._dynamics, *others) = assemble(vehicle, stations, measured, self._settings)
        (self._balance,) = (part for part in others if isinstance(part, BalancePart))
        return Goal((self,))

    def needs(self, vehicle: Vehicle) -> Needs:
        """Return nothing: see ``Term``."""
        return Centring(self._residual).needs(vehicle)

    def part(self, scene: Scene, place: Place) -> CentringPart:
        """Return centring in its place: see ``Term``."""
        self._centring = Centring(self._residual).part(scene, place)
        return self._centring

    def correct(self, plan: Plan) -> None:
        """Lower c by the gain times the low-passed imbalance of this plan, taken at the middle of the vehicle."""
        scene, balance, targets = self._measured, self._balance, self._centring.coefficients["target"]
        horizon = Horizon(plan.first, scene.stations.points[plan.first : plan.first + self._settings.stages + 1], 0.0, 0, binding=True)
        scene.motion.z[:], scene.motion.kappa[:] = plan.z, plan.kappa
        self._dynamics.extend(horizon, 1)
        balance.centring.extend(horizon, 1)
        balance.linearise(horizon)
        reach = balance.measured.reached["reach"]
        here = np.arange(max(plan.first - balance.window.before, 0), plan.first + balance.window.places)
        measured = reach[0, here] - reach[1, here]
        smooth = gaussian_filter1d(np.where(np.isfinite(measured), measured, 0.0), CRUDE_LOW_PASS_M / self._settings.step, mode="nearest")
        stage = here - self._middle
        inside = (stage >= plan.first) & (stage < len(targets))
        weight = self._residual.lead[stage[inside]]
        targets[stage[inside]] -= CRUDE_GAIN * 0.5 * (1.0 + weight) * smooth[inside]


def deferred(road: Road, vehicle: Vehicle, settings: PlannerSettings, driven: list[Case]) -> Swept:
    """Drive with the crude rule."""
    rule = Deferred(vehicle, settings)
    driven.append(Case(road, vehicle, "deferred correction", settings=settings))
    done = drive_case(driven[-1], rule.objective, on_plan=rule.correct)
    return Swept(driven[-1], done, envelope_of(done))


def family(driven: list[Case]) -> pd.DataFrame:
    """Return every S-turn driven with every candidate."""
    ways: dict[str, Callable[[Road, Vehicle], Swept]] = {
        "geometric": lambda road, vehicle: run(road, vehicle, geometric, RTI, driven),
        "deferred correction": lambda road, vehicle: deferred(road, vehicle, RTI, driven),
        "balanced": lambda road, vehicle: run(road, vehicle, balanced, RTI, driven),
        "balanced, SQP": lambda road, vehicle: run(road, vehicle, balanced, SQP, driven),
        "no stationary share": lambda road, vehicle: run(road, vehicle, balanced_with(share=0.0), RTI, driven),
        "squares": lambda road, vehicle: run(road, vehicle, balanced_with(rounding=1e3, share=0.1), RTI, driven),
        "squares, no share": lambda road, vehicle: run(road, vehicle, balanced_with(rounding=1e3, share=0.0), RTI, driven),
        "step not relaxed": lambda road, vehicle: run(road, vehicle, balanced_with(relaxation=1.0), RTI, driven),
        "35 m ahead": lambda road, vehicle: run(road, vehicle, balanced_with(ahead=35.0), RTI, driven),
        "80 m ahead": lambda road, vehicle: run(road, vehicle, balanced_with(ahead=80.0), RTI, driven),
    }
    rows = []
    for name, curvature, sharpness in product(VEHICLES, CURVATURES, SHARPNESSES):
        road, vehicle = case_road(curvature, sharpness), load_vehicle(name)
        case = {"vehicle": name, "curvature": curvature, "sharpness": sharpness}
        rows += [case | {"objective": way} | numbers(drive(road, vehicle)) for way, drive in ways.items()]
        print(f"{name}, {curvature:g} 1/m, {sharpness:g} 1/m^2", file=sys.stderr)
    return pd.DataFrame(rows)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return every candidate against the geometric weight, over the whole family."""
    keys = ["vehicle", "curvature", "sharpness"]
    base = table[table["objective"] == "geometric"].set_index(keys)
    rows = []
    for (name, way), mine in table.groupby(["vehicle", "objective"], sort=False):
        here = mine.set_index(keys)
        there = base.loc[here.index]
        gain = 100.0 * (1.0 - here["mean_abs_imbalance_m"] / there["mean_abs_imbalance_m"])
        reach = 100.0 * (here["furthest_m"] / there["furthest_m"] - 1.0)
        rows.append(
            {
                "vehicle": name,
                "objective": way,
                "mean_abs_imbalance_m": here["mean_abs_imbalance_m"].mean(),
                "gain_percent": 100.0 * (1.0 - here["mean_abs_imbalance_m"].mean() / there["mean_abs_imbalance_m"].mean()),
                "least_gain_percent": gain.min(),
                "max_abs_imbalance_m": here["max_abs_imbalance_m"].max(),
                "furthest_mean_percent": reach.mean(),
                "furthest_most_percent": reach.max(),
                "squared_changes_ratio": (here["sum_squared_changes"] / there["sum_squared_changes"]).mean(),
                "max_kappa_ratio": (here["max_kappa_per_m"] / there["max_kappa_per_m"]).max(),
                "programs": here["programs"].mean(),
            }
        )
    return pd.DataFrame(rows)


def trade_off(driven: list[Case]) -> pd.DataFrame:
    """Return gain against growth of the largest reach, for shares of the stationary residual with and without rounding."""
    rows = []
    for name, rounding, share in product(VEHICLES, (0.05, 1e3), (0.0, 0.005, 0.01, 0.015, 0.03, 0.1, 0.3)):
        vehicle, gains, reaches = load_vehicle(name), [], []
        for curvature, sharpness in product(CURVATURES, SHARPNESSES):
            road = case_road(curvature, sharpness)
            base, mine = (
                numbers(run(road, vehicle, objective, RTI, driven))
                for objective in (geometric, balanced_with(rounding=rounding, share=share))
            )
            gains.append((mine["mean_abs_imbalance_m"], base["mean_abs_imbalance_m"]))
            reaches.append(mine["furthest_m"] / base["furthest_m"])
        left, before = np.array(gains).sum(axis=0)
        rows.append(
            {
                "vehicle": name,
                "rounding_m": rounding,
                "share": share,
                "gain_percent": 100.0 * (1.0 - left / before),
                "furthest_most_percent": 100.0 * (max(reaches) - 1.0),
            }
        )
    return pd.DataFrame(rows)


def convergence(driven: list[Case]) -> pd.DataFrame:
    """Return the imbalance that so many programs leave when the whole example is planned in one horizon, from the geometric plan on."""
    rows = []
    for name in VEHICLES:
        vehicle, road = load_vehicle(name), case_road(*EXAMPLE)
        settings = whole_manoeuvre(road, RTI.step)
        settings = replace(settings, horizon=settings.horizon + 50.0, replan=settings.horizon)
        start = numbers(run(road, vehicle, geometric, settings, driven))
        for relaxation, rounds in product((1.0, 4.0 / 3.0), ROUNDS):
            objective = balanced_with(ahead=np.inf, rounds=rounds, relaxation=relaxation)
            found = numbers(run(road, vehicle, objective, settings, driven))
            rows.append({"vehicle": name, "rule": f"balanced, step x {relaxation:.2f}", "rounds": rounds} | found)
        rows.append({"vehicle": name, "rule": "geometric", "rounds": 0} | start)
        target: FloatArray | None = None
        for rounds in range(1, max(ROUNDS) + 1):
            found_c, target = _corrected(Case(road, vehicle, f"geometric, target corrected {rounds - 1} times", settings=settings), target)
            driven.append(found_c.case)
            if rounds in ROUNDS:
                rows.append({"vehicle": name, "rule": "deferred correction", "rounds": rounds} | numbers(found_c))
    return pd.DataFrame(rows)


def _corrected(case: Case, target: FloatArray | None) -> tuple[Swept, FloatArray]:
    """Plan the whole manoeuvre to convergence with the target c, and return the next one by the crude rule."""

    def objective(stations: Stations, vehicle: Vehicle) -> Goal:
        residual = _residual_of(geometric(stations, vehicle))
        return Goal((Centring(residual if target is None else replace(residual, target=target)),))

    found, vehicle = swept(case, objective), case.vehicle
    stations = found.drive.stations
    middle = 0.5 * (vehicle.reach_ahead - vehicle.reach_behind)
    smooth = gaussian_filter1d(found.left - found.right, CRUDE_LOW_PASS_M / 0.25, mode="nearest")
    seen = np.interp(stations.s + middle, found.envelope.s, smooth, right=0.0)
    residual = _residual_of(objective(stations, vehicle))
    return found, residual.target - CRUDE_GAIN * 0.5 * (1.0 + residual.lead) * seen


def real_roads(driven: list[Case]) -> pd.DataFrame:
    """Return both objectives on the benchmark's real roads, with its limits."""
    rows = []
    suite = Suite()
    for name, road_name in product(VEHICLES, ROADS):
        vehicle = load_vehicle(name)
        road = with_limits(load_road(road_name), vehicle, suite)
        for way, objective in (("geometric", geometric), ("balanced", balanced)):
            try:
                found = run(road, vehicle, objective, RTI, driven)
            except HdvplanError as error:
                print(f"{road_name}, {name}, {way}: {error}", file=sys.stderr)
                continue
            left, right = road.limits.table(found.envelope.s)[:2] if road.limits is not None else (np.inf, -np.inf)
            room = float(min(np.min(left - found.left), np.min(-right - found.right)))
            rows.append({"vehicle": name, "road": road_name, "objective": way, "clearance_m": room} | numbers(found))
        print(f"{name}, {road_name}", file=sys.stderr)
    return pd.DataFrame(rows)


def step_times(driven: list[Case]) -> pd.DataFrame:
    """Return the mean RTI step of both objectives [ms] on the example, without limits and within the benchmark's; rounds alternate."""
    rows = []
    for name in VEHICLES:
        vehicle, free = load_vehicle(name), case_road(*EXAMPLE)
        for limits, road in (("none", free), ("0.5 m beyond", with_limits(free, vehicle, Suite()))):
            fastest: dict[str, FloatArray] = {}
            cases = [Case(road, vehicle, objective, settings=RTI) for objective in ("geometric", "balanced")]
            driven += cases
            for case in cases:
                prepare(case)
            for _ in range(TIMED_ROUNDS):
                for case in cases:
                    gc.collect()
                    gc.disable()
                    plans = drive_case(case).plans[1:]
                    gc.enable()
                    times = 1e3 * np.array([plan.times.total for plan in plans])
                    fastest[case.objective_name] = np.minimum(fastest.get(case.objective_name, np.full(len(times), np.inf)), times)
            means = {f"{way}_ms": float(np.mean(times)) for way, times in fastest.items()}
            rows.append({"vehicle": name, "limits": limits} | means | {"ratio": means["balanced_ms"] / means["geometric_ms"]})
    return pd.DataFrame(rows)


def example(name: str) -> dict[str, Swept]:
    """Return the example S-turn driven with both objectives."""
    road, vehicle = case_road(*EXAMPLE), load_vehicle(name)
    return {objective: swept(Case(road, vehicle, objective, settings=RTI)) for objective in ("geometric", "balanced")}


def draw_examples(path: Path) -> None:
    """Draw reach to both sides, imbalance and curvature of the example."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - takes half a second

    from hdvplan.report.style import styled  # noqa: PLC0415 - as above

    with styled():
        figure = Figure(figsize=(11.0, 8.0), layout="constrained")
        axes = figure.subplots(3, len(VEHICLES), sharex="col", sharey="row")
        for column, name in enumerate(VEHICLES):
            for (way, found), colour in zip(example(name).items(), ("0.45", "#0072B2"), strict=True):
                s = found.envelope.s
                axes[0, column].plot(s, found.left, color=colour, label=f"{way}: left")
                axes[0, column].plot(s, found.right, color=colour, linestyle="--", label="right")
                axes[1, column].plot(s, found.left - found.right, color=colour, label=way)
                axes[2, column].plot(found.drive.stations.s[: len(found.drive.kappa)], found.drive.kappa, color=colour, label=way)
            axes[0, column].plot(s, found.expected.half_width, color="#E69F00", linewidth=0.8, label="stationary half width")
            axes[2, column].plot(s, found.drive.road.path.at(s).curvature, color="#E69F00", linewidth=0.8, label="road")
            axes[0, column].set_title(name)
            axes[2, column].set_xlabel("arclength s [m]")
        for row, label in enumerate(("reach [m]", "left + right [m]", "curvature [1/m]")):
            axes[row, 0].set_ylabel(label)
            axes[row, 0].legend(fontsize="small")
            for panel in axes[row]:
                panel.grid(visible=True, alpha=0.3)
        figure.suptitle(f"S-turn of {EXAMPLE[0]:g} 1/m and {EXAMPLE[1]:g} 1/m^2, receding horizon, as simulated")
        figure.savefig(path, dpi=120)


def draw_convergence(table: pd.DataFrame, trades: pd.DataFrame, path: Path) -> None:
    """Draw the imbalance over rounds, and gain against reach."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - takes half a second

    from hdvplan.report.style import styled  # noqa: PLC0415 - as above

    with styled():
        figure = Figure(figsize=(11.0, 4.2), layout="constrained")
        over, against = figure.subplots(1, 2)
        for name, line in zip(VEHICLES, ("--", "-"), strict=True):
            mine = table[table["vehicle"] == name]
            for rule, part in mine[mine["rounds"] > 0].groupby("rule"):
                over.loglog(part["rounds"], part["mean_abs_imbalance_m"], linestyle=line, marker=".", label=f"{name}: {rule}")
            here = trades[trades["vehicle"] == name]
            for what, part in (("magnitude", here[here["rounding_m"] < 1.0]), ("square", here[here["rounding_m"] > 1.0])):
                against.plot(part["furthest_most_percent"], part["gain_percent"], linestyle=line, marker="o", label=f"{name}: {what}")
        over.set(xlabel="programs, or corrections of c", ylabel="mean |left + right| [m]", title="One horizon over the whole S-turn")
        against.set(
            xlabel="largest growth of a largest reach [%]", ylabel="gain in mean |left + right| [%]", title="Share of the residual 0 to 0.3"
        )
        for panel in (over, against):
            panel.grid(visible=True, alpha=0.3)
            panel.legend(fontsize="x-small")
        figure.savefig(path, dpi=120)


def draw_roads(table: pd.DataFrame, path: Path) -> None:
    """Draw the mean imbalance on the real roads."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - takes half a second

    from hdvplan.report.style import styled  # noqa: PLC0415 - as above

    with styled():
        figure = Figure(figsize=(11.0, 4.5), layout="constrained")
        for axes, name in zip(figure.subplots(1, len(VEHICLES), sharey=True), VEHICLES, strict=True):
            wide = table[table["vehicle"] == name].pivot_table(index="road", columns="objective", values="mean_abs_imbalance_m", sort=False)
            rows = np.arange(len(wide))
            for offset, way, colour in ((-0.2, "geometric", "0.6"), (0.2, "balanced", "#0072B2")):
                axes.barh(rows + offset, wide[way], height=0.4, color=colour, label=way)
            axes.set(yticks=rows, yticklabels=wide.index, xlabel="mean |left + right| [m]", title=name)
            axes.invert_yaxis()
            axes.legend()
        figure.savefig(path, dpi=120)


def road_gains(table: pd.DataFrame) -> pd.DataFrame:
    """Return one row a road and vehicle, both objectives beside each other."""
    rows = []
    for (name, road), mine in table.groupby(["vehicle", "road"], sort=False):
        by = mine.set_index("objective")
        base, ours = by.loc["geometric"], by.loc["balanced"]
        rows.append(
            {
                "vehicle": name,
                "road": road,
                "geometric_m": base["mean_abs_imbalance_m"],
                "balanced_m": ours["mean_abs_imbalance_m"],
                "gain_percent": 100.0 * (1.0 - ours["mean_abs_imbalance_m"] / base["mean_abs_imbalance_m"]),
                "worst_geometric_m": base["max_abs_imbalance_m"],
                "worst_balanced_m": ours["max_abs_imbalance_m"],
                "furthest_geometric_m": base["furthest_m"],
                "furthest_balanced_m": ours["furthest_m"],
                "clearance_geometric_m": base["clearance_m"],
                "clearance_balanced_m": ours["clearance_m"],
                "squared_changes_ratio": ours["sum_squared_changes"] / base["sum_squared_changes"],
            }
        )
    return pd.DataFrame(rows)


def write(out: Path, name: str, table: pd.DataFrame) -> None:
    """Write a table as CSV and Markdown."""
    write_atomically(out / f"{name}.csv", csv_bytes(table))
    text = table.copy()
    for column in text.columns:
        if text[column].dtype == float:
            digits = 1 if column.endswith("percent") else 6 if column == "sum_squared_changes" else 4 if column in FINE else 3
            text[column] = text[column].map(f"{{:.{digits}f}}".format)
    write_atomically(out / f"{name}.md", f"{markdown_table(text, text=WORDS)}\n".encode())


def main() -> None:
    """Measure everything and write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/balanced"), metavar="DIR")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    driven: list[Case] = []
    cases = family(driven)
    write(out, "s-turns", cases)
    write(out, "summary", summary(cases))
    rounds, trades = convergence(driven), trade_off(driven)
    write(out, "convergence", rounds)
    write(out, "trade-off", trades)
    write(out, "step-times", step_times(driven))
    roads = real_roads(driven)
    write(out, "roads", road_gains(roads))
    draw_examples(out / "example.png")
    draw_convergence(rounds, trades, out / "convergence.png")
    draw_roads(roads, out / "roads.png")
    write_record(out, driven)
    print((out / "summary.md").read_text())


if __name__ == "__main__":
    use_one_thread()
    main()
