"""The Python interface: what ``import hdvplan`` promises."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

import hdvplan
from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import Centring, stationary
from hdvplan.need.answer import Need
from hdvplan.need.search import Least


def test_ten_lines_lead_from_a_road_to_a_report(tmp_path: Path) -> None:
    road = hdvplan.load_road("uturn").with_limits(2.6, 2.6)
    vehicle = hdvplan.load_vehicle("bus")
    case = hdvplan.Case(road, vehicle, settings=hdvplan.PlannerSettings(horizon=60.0))
    result = hdvplan.plan(case)
    print(result.balance.max_left, result.balance.max_right, result.balance.min_clearance)  # noqa: T201 - as users do
    for breach in result.balance.breaches:
        print(breach.side, breach.s_deepest, breach.depth)  # noqa: T201 - as users do
    hdvplan.write_plan(result, tmp_path / "uturn", pictures=["png"])
    hdvplan.plan_figure(result).savefig(tmp_path / "plan.pdf")
    hdvplan.write_report([tmp_path / "uturn"], tmp_path / "report.html")

    assert result.status == "ok"
    assert result.balance.min_clearance == pytest.approx(2.6 - 2.48, abs=0.01)  # the published reach's digits
    assert hdvplan.summary_of(result)["plans"] == len(result.drive.plans)
    need = Need(PLAIN, None, Least(2.48, result, 0.0, 0.0, 1, None), None, None, None)
    assert repr(result).startswith("<Result of bus on uturn: ok, least room 0.1")  # what a notebook shows
    assert repr(result.drive) == f"<Drive of bus on uturn: {result.drive.road.path.length:.1f} m, {len(result.drive.plans)} plans>"
    assert repr(need) == "<Need of bus on uturn: 2.48 m half width>"
    assert repr(case) == f"<Case: bus on <Road uturn: {road.path.length:.1f} m, with limits>, geometric, riccati>"
    assert all((tmp_path / name).stat().st_size > 0 for name in ("uturn/plan.png", "plan.pdf", "report.html"))


def test_a_plan_takes_the_command_line_s_names_and_tells_how_far_it_is() -> None:
    shares: list[float] = []
    settings = hdvplan.PlannerSettings(horizon=50.0)
    case = hdvplan.Case(hdvplan.load_road("sturn"), hdvplan.load_vehicle("bus"), "lead-axle", "piqp", settings)
    result = hdvplan.plan(case, on_progress=shares.append)
    assert (result.objective, result.solver) == ("lead-axle", "piqp")
    assert result.case == case
    assert shares[-1] == 1.0
    for wrong, words in ((replace(case, solver="none"), "unknown solver"), (replace(case, objective="none"), "unknown objective")):
        with pytest.raises(hdvplan.HdvplanError, match=words):
            hdvplan.plan(wrong)


UNIT = hdvplan.Unit(wheelbase=6.0, front_overhang=2.7, rear_overhang=3.3, width=2.55)
PLAIN = hdvplan.Case(hdvplan.load_road("uturn"), hdvplan.load_vehicle("bus"))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: hdvplan.Case(**vars(PLAIN) | {"road": "uturn"}), r"road must be a Road, not 'uturn'\nhint: hdvplan\.load_road"),
        (lambda: hdvplan.Case(**vars(PLAIN) | {"vehicle": "bus"}), r"vehicle must be a Vehicle, not 'bus'\nhint: hdvplan\.load_vehicle"),
        (lambda: hdvplan.Case(**vars(PLAIN) | {"bias": 0.3}), r"bias must be a Bias, not 0\.3\nhint: hdvplan\.Bias\.constant"),
        (lambda: hdvplan.Case(**vars(PLAIN) | {"settings": {}}), r"settings must be a PlannerSettings, not \{\}"),
        (lambda: replace(PLAIN, objective="balancd"), r"unknown objective 'balancd'\nhint: did you mean 'balanced'\?"),
        (lambda: hdvplan.plan("uturn"), r"case must be a Case, not 'uturn'\nhint: hdvplan\.Case\(road, vehicle\)"),  # type: ignore[arg-type]
        (lambda: hdvplan.closed_loop(PLAIN), r"result must be a Result, not <Case: bus on .*\nhint: hdvplan\.plan"),  # type: ignore[arg-type]
        (lambda: hdvplan.judge(PLAIN, [[0, 0], [1, 1]]), r"path must be a GivenPath, not \[\[0, 0\], \[1, 1\]\]\nhint: "),  # type: ignore[arg-type]
        (lambda: hdvplan.PlannerSettings(horizon="50"), r"horizon must be a number, not '50'"),  # type: ignore[arg-type]
        (lambda: hdvplan.Vehicle("a", [UNIT]), r"units must be a tuple, not \[Unit\("),  # type: ignore[arg-type]
        (lambda: hdvplan.Vehicle("a", ("b",)), r"a unit must be a Unit, not 'b'"),  # type: ignore[arg-type]
        (lambda: hdvplan.Vehicle("a", (UNIT,), max_curvature="b"), r"max_curvature must be a number, not 'b'"),  # type: ignore[arg-type]
        (lambda: replace(UNIT, wheelbase=-3.8), r"wheelbase = -3\.8 m must lie between 0\.5 and 50 m\nhint: "),
        (lambda: hdvplan.Unit(6.0, 2.7, 3.3, "2.55"), r"width must be a number, not '2\.55'"),  # type: ignore[arg-type]
    ],
)  # fmt: skip
def test_what_is_of_another_kind_is_refused_where_it_is_made(wrong: Callable[[], object], words: str) -> None:
    with pytest.raises(hdvplan.HdvplanError) as refused:
        wrong()
    assert re.match(words, "\n".join([str(refused.value), *getattr(refused.value, "__notes__", ())]))


def test_a_second_plan_of_its_kind_tabulates_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    tabulated: list[str] = []

    def tabulate(vehicle: hdvplan.Vehicle, curvature: FloatArray) -> Centring:
        tabulated.append(vehicle.name)
        return stationary(vehicle, curvature)

    monkeypatch.setattr("hdvplan.centring.stationary.stationary", tabulate)
    unit = hdvplan.Unit(wheelbase=6.0, front_overhang=2.7, rear_overhang=3.3, width=2.55)
    first, second = hdvplan.Vehicle("first", (unit,)), hdvplan.Vehicle("second", (unit, replace(unit, front_overhang=0.0)))
    case = hdvplan.Case(hdvplan.load_road("sturn"), first, settings=hdvplan.PlannerSettings(horizon=50.0))
    for again in (case, case, replace(case, objective="art-weighted:0.3"), replace(case, objective="art-weighted:0.4")):
        hdvplan.plan(again)
    assert tabulated == ["first"]
    hdvplan.plan(replace(case, vehicle=second))
    assert tabulated == ["first", "second"]


def test_importing_it_loads_nothing_heavy() -> None:
    code = "import sys, hdvplan; dir(hdvplan); print([m for m in ('numpy', 'pandas', 'matplotlib') if m in sys.modules])"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603 - our own
    assert ended.stdout == "[]\n"


def test_public_names_are_told_before_they_are_loaded() -> None:
    assert dir(hdvplan) == sorted(hdvplan.__all__)
    assert {"run", "LocalEngine", "connected"} <= {*dir(hdvplan.study)}


def test_every_public_name_is_there_and_is_what_its_home_has() -> None:
    assert sorted(hdvplan.__all__) == dir(hdvplan)
    for name in hdvplan.__all__:
        assert getattr(hdvplan, name) is not None
        if name == "study":  # a package, public as a whole
            assert hdvplan.study is import_module("hdvplan.study")
        elif name != "__version__":
            assert getattr(import_module(getattr(hdvplan, name).__module__), name) is getattr(hdvplan, name)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = hdvplan.nothing  # type: ignore[attr-defined] # that is the point
