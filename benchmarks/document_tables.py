"""The numbers of README and docs, each taken from the tables in results as the text that a document has."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

ROOT = Path(__file__).parents[1]
_MILLI = 1e3
_SAME_M = 1e-4  # an exact program that breaks limits by less sees what the planner sees
UTURN, SIDES = ("proposed method, max right", "proposed method, max left"), ("max left", "max right")


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


def unended(solver: str) -> str:
    """Return how many of a solver's drives on the benchmark roads do not end."""
    rows = table("roads/timing.csv")
    return str(int(((rows["solver"] == solver) & (rows["status"] != "ok")).sum()))


def schemes() -> list[str]:
    """Return how many times as long SQP takes as RTI, for both vehicles, and how far their envelopes differ at most [mm]."""
    rows = table("roads/schemes.csv")
    rows = rows[rows["solver"] == "riccati"]
    means = rows.groupby("vehicle")[["rti_mean_ms", "sqp_mean_ms"]].sum()
    ratio = means["sqp_mean_ms"] / means["rti_mean_ms"]
    return [f"{ratio[vehicle]:.1f}" for vehicle in ("bus", "tractor-trailer")] + [f"{_MILLI * rows['envelope_difference_m'].max():.2f}"]


def peers() -> list[str]:
    """Return the least and largest factor of the exact programs' time, and how far their optima are off where they keep all limits [m]."""
    rows = table("peers/peers.csv")
    ratio, differs = rows[["ipopt_ratio", "fatrop_ratio"]].to_numpy(), rows[["ipopt_differs_m", "fatrop_differs_m"]].max(axis=1)
    return [f"{ratio.min():.0f}", f"{ratio.max():.0f}", f"{differs[rows['ipopt_cuts_m'] < _SAME_M].max():.0e}"]


def cut() -> list[str]:
    """Return how deep the exact program cuts limits between its points [mm], and how far its path is off there [mm]."""
    rows = table("peers/peers.csv")
    rows = rows[rows["ipopt_cuts_m"] >= _SAME_M]
    return [f"{_MILLI * rows[name].max():.0f}" for name in ("ipopt_cuts_m", "ipopt_differs_m")]


def balanced() -> list[str]:
    """Return by how many per cent a place's imbalance falls, for both vehicles, and the least and largest factor of a step's time."""
    gains = table("balanced/summary.csv")
    gains = gains[gains["objective"] == "balanced"]
    ratio = table("balanced/step-times.csv")["ratio"]
    return [f"{gain:.0f}" for gain in gains["gain_percent"]] + [f"{ratio.min():.1f}", f"{ratio.max():.1f}"]


def balance_row(vehicle: str, objective: str) -> list[str]:
    """Return one row of the study of the balance: imbalance [m], gains [%], growth of the reach [%] and of the curvature."""
    rows = table("balanced/summary.csv")
    row = rows[(rows["vehicle"] == vehicle) & (rows["objective"] == objective)].iloc[0]
    forms = {"gain_percent": "{:.1f}", "least_gain_percent": "{:.1f}", "furthest_mean_percent": "{:.1f}", "furthest_most_percent": "{:.1f}"}
    forms |= {"squared_changes_ratio": "{:.2f}", "max_kappa_ratio": "{:.2f}"}
    return [f"{row['mean_abs_imbalance_m']:.2g}"] + [form.format(row[name]) for name, form in forms.items()]


def balance_time(vehicle: str, limits: str) -> list[str]:
    """Return the time of a step with the geometric objective and with the balance [ms], and the factor."""
    rows = table("balanced/step-times.csv")
    row = rows[(rows["vehicle"] == vehicle) & (rows["limits"] == limits)].iloc[0]
    return [f"{row['geometric_ms']:.3f}", f"{row['balanced_ms']:.3f}", f"{row['ratio']:.2f}"]


def balance_more() -> list[str]:
    """Return the least and the most that the balance adds to a step [us]."""
    rows = table("balanced/step-times.csv")
    more = 1e3 * (rows["balanced_ms"] - rows["geometric_ms"])
    return [f"{more.min():.0f}", f"{more.max():.0f}"]


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


def whole_routes() -> str:
    """Return how many routes are extracted without a gap."""
    return str((table("liechtenstein/lines.csv")["whole"] == "yes").sum())


def kills() -> str:
    """Return how often the study was killed."""
    return str(len(table("liechtenstein/kills.csv")))


def checked() -> list[str]:
    """Return how many cells were planned again, by how much they differ at most [m], and how many are proved."""
    rows = table("liechtenstein/checked.csv")
    apart = (rows["spare_m"] - rows["study_spare_m"]).abs().max()
    return [str(len(rows)), f"{apart:.2g}", str(int(rows["proved_from_m"].notna().sum()))]


def objectives(first: str, second: str) -> Callable[[], list[str]]:
    """Return what returns one row of the objectives' study."""
    return lambda: pairs("objectives", (first, second))


RUN_INS_M = (10, 20, 40, 60, 80, 100, 150)


def forgotten() -> list[str]:
    """Return how far a bus's plan is from one that began this far before it, at most [m]."""
    rows = table("long-roads/forgetting.csv")
    most = rows[rows["vehicle"] == "bus"].set_index("run_in_m")["max_m"]
    return [_power(most[run_in]) for run_in in RUN_INS_M]


def long_road(km: int, plan: str) -> list[str]:
    """Return the largest memory of a plan of a long road [MB], and its CPU time [s/km]."""
    row = _long(km, plan)
    return [f"{row['peak_mb']:.0f}", f"{row['cpu_s_per_km']:.2f}"]


def joints() -> list[str]:
    """Return in how many stretches the longest road was planned, and how far they lie apart where they meet [m]."""
    row = _long(1000, "stretches")
    return [str(row["stretches"]), _power(row["stretches_apart_mm"] / _MILLI)]


def _long(km: int, plan: str) -> dict[str, Any]:
    rows = table("long-roads/long_roads.csv")
    return {str(name): value for name, value in rows[(rows["km"] == km) & (rows["plan"] == plan)].iloc[0].items()}


def _power(value: float) -> str:
    """Return a number to one digit, such as 7e-3."""
    return f"{value:.0e}".replace("e-0", "e-")


def handed_out() -> list[str]:
    """Return the driver's time for each of very many cells [ms], its growth without and with tables [MB], and the overhead [ms]."""
    rows = table("study-cells/study_cells.csv")
    last, end = rows.iloc[-2], rows.iloc[-1]
    spent = _MILLI * last["driver_cpu_s"] / last["cells"]
    return [f"{spent:.1f}", f"{last['mb']:.0f}", f"{end['mb']:.0f}", f"{end['overhead_ms_per_cell']:.1f}"]


def gate(how: str) -> list[str]:
    """Return how many comparisons of identical programs there were, how many of them were red, and the same of worse programs."""
    rows = table("gate/gate.csv")
    mine = rows[rows["how"] == how]
    sides = (mine[mine["program"] == "same"], mine[mine["program"] != "same"])
    return [str(int(side[column].sum())) for side in sides for column in ("comparisons", "regressed")]


def gate_seconds() -> list[str]:
    """Return how long the longest run of identical programs took, and that of worse ones [s]."""
    rows = table("gate/gate.csv")
    longest = rows.groupby(rows["program"] == "same")["longest [s]"].max()
    return [f"{longest[True]:.0f}", f"{longest[False]:.0f}"]


def gate_noise() -> list[str]:
    """Return by how much times differ between pairs, quiet and loaded, and within a pair, in the worst cell [%]."""
    noise = table("gate/noise.csv").set_index("situation").loc[["quiet", "loaded"]]
    return [f"{value:.1f}" for column in ("between pairs [%]", "within a pair [%]") for value in noise[column]]
