"""Draw what a rigid vehicle can reach through a tight place: within limits too narrow, and some that are a little wider.

Writes reach.csv (where each set is lost, and how many cells it has), reach.png, run.json.

python benchmarks/proof_picture.py [--out results/proof-reach] [--road R] [--vehicle V] [--half-widths A,B] [--s-from S] [--s-to S]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from cases import case_within, free_case

from hdvplan.case import Case
from hdvplan.judging.balance import KEPT_M
from hdvplan.proof.answer import RIGID, ROUNDING_M, grid_of
from hdvplan.proof.reach import outline_of, reachable
from hdvplan.proof.space import beside, frame_of
from hdvplan.record import write_record
from hdvplan.report.proof_plots import Followed, reach_figure
from hdvplan.report.style import figure_bytes

_AROUND_M = 50.0  # of the stretch: no point of a rigid vehicle has its foot further away
_FINE = RIGID[1]


def main(arguments: Sequence[str] | None = None) -> None:
    """Follow the sets and draw them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/proof-reach"))
    parser.add_argument("--road", default="monaco_fairmont_hairpin")
    parser.add_argument("--vehicle", default="bus")
    parser.add_argument("--half-widths", type=lambda text: [float(part) for part in text.split(",")], default=[3.25, 3.05])
    parser.add_argument("--s-from", type=float, default=290.0)
    parser.add_argument("--s-to", type=float, default=345.0)
    options = parser.parse_args(arguments)
    cases = [case_within(free_case(options.road, options.vehicle), width) for width in options.half_widths]
    sets = [
        followed(case, options.s_from, options.s_to, f"limits at ±{width:.2f} m")
        for case, width in zip(cases, options.half_widths, strict=True)
    ]
    ends = [{"half_width": width, **_told(one)} for width, one in zip(options.half_widths, sets, strict=True)]
    figure = reach_figure(
        sets, f"{options.vehicle} on {options.road}: all that any steering reaches from any pose at s = {options.s_from:.0f} m"
    )
    options.out.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(ends).to_csv(options.out / "reach.csv", index=False, float_format="%.4f", lineterminator="\n")
    (options.out / "reach.png").write_bytes(figure_bytes(figure, "png"))
    write_record(options.out, cases)


def _told(one: Followed) -> dict[str, object]:
    """Return where a set is lost [m], empty where it is not, and the mean number of its cells of heading."""
    reached = one.reached
    return {"empty_s": None if reached.empty < 0 else float(one.s[reached.empty]), "cells_mean": float(np.mean(reached.filled))}


def followed(case: Case, s_from: float, s_to: float, label: str) -> Followed:
    """Return what the leading unit of a case can reach, by the bounds and with the room of a proof."""
    road = replace(case.road, path=case.road.path.extended(_AROUND_M, _AROUND_M))
    space = beside(road, s_from - _AROUND_M, s_to + _AROUND_M, room=KEPT_M + ROUNDING_M)
    assert space is not None  # noqa: S101 - for the type checker: the road has limits
    outline = outline_of(case.vehicle.lead, two_regions=False)
    frame = frame_of(road.path, np.arange(s_from, s_to, _FINE.step))
    reached = reachable(outline, case.vehicle.max_curvature, space, frame, grid_of(frame, _FINE.cell), two_regions=False)
    return Followed(label, frame.s, reached)


if __name__ == "__main__":
    main()
