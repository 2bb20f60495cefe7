"""A program polishes what the generators of manoeuvres found: how much is gained, and what stays as it was."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hdvplan.report.manoeuvres import reversal_json
from hdvplan.turning.reversing import answer as answering
from hdvplan.turning.reversing.answer import Answer, reversing
from hdvplan.turning.reversing.legs import Draft
from hdvplan.turning.reversing.options import SiteOptions, Template
from hdvplan.turning.reversing.words import closed_form, details
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.nightly import nightly
from tests.turning.reversals import refuse


@cache
def docked(vehicle: str, template: Template, spacing: float = 4.0, *, polish: bool = True) -> Answer:
    return reversing(load_vehicle(vehicle), template, SiteOptions(door_spacing=spacing), starts=1, polish=polish)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vehicle", "template", "gain"),
    [
        ("rigid-truck", Template.DOCK_90, 0.15),
        nightly("rigid-truck", Template.DOCK_45, 0.5),
        nightly("tractor-semitrailer", Template.DOCK_90, 0.35),
        ("tractor-semitrailer", Template.DOCK_45, 0.7),
        nightly("WB-62", Template.DOCK_90, 1.3),
    ],
)
def test_a_dock_needs_less_where_the_vehicle_swings_out_first(vehicle: str, template: Template, gain: float) -> None:
    polished, found = (docked(vehicle, template, polish=polish).chosen for polish in (True, False))
    assert found.manoeuvre.size - polished.manoeuvre.size > gain  # measured: 0.20, 0.59, 0.41, 0.83, 1.58 m
    assert (polished.polished, found.polished) == (True, False)
    assert polished.sizes == found.sizes == (found.manoeuvre.size,)
    kappa = polished.manoeuvre.legs[-1].reversed().kappa
    assert kappa[0] < 0.0 < kappa.max()  # away from the side to which it turns


@pytest.mark.slow
@pytest.mark.parametrize("template", [Template.DOCK_90, nightly(Template.DOCK_45)])
def test_a_polished_dock_is_judged_as_any_and_ends_as_it_did(template: Template) -> None:
    polished, found = (docked("tractor-semitrailer", template, polish=polish) for polish in (True, False))
    manoeuvre = polished.chosen.manoeuvre
    assert polished.room.min() > -1e-9
    assert manoeuvre.lacking == 0.0
    ends, before = ([leg.lead[at] for leg, at in zip(one.chosen.manoeuvre.legs, (0, -1), strict=True)] for one in (polished, found))
    assert np.allclose(ends[1], before[1], atol=1e-12)  # at the door
    assert ends[0][2] == pytest.approx(np.pi, abs=1e-9)  # along the wall
    back, drawn = (one.chosen.manoeuvre.legs[-1] for one in (polished, found))
    assert np.abs(back.beta[[0, -1]]).max() < 1e-8
    assert np.abs(back.beta).max() < np.abs(drawn.beta).max() + 1e-4  # the program keeps rows to 1e-5, and sees poses 0.2 m apart
    assert np.abs(back.kappa).max() <= polished.vehicle.max_curvature


def test_what_is_said_tells_what_was_polished() -> None:
    polished, found = (docked("tractor-semitrailer", Template.DOCK_90, polish=polish) for polish in (True, False))
    assert details(polished).startswith("polished from 27.60 m, ")
    assert "polished" not in details(found)
    assert closed_form(polished.vehicle, polished.template, polished.chosen) is None
    assert [reversal_json(one)["tried"][0]["polished"] for one in (polished, found)] == [True, False]


@pytest.mark.slow
def test_the_apron_of_a_dock_askew_falls_with_the_spacing_of_doors() -> None:
    narrow, wide = (docked("tractor-semitrailer", Template.DOCK_45, spacing).chosen for spacing in (4.0, 4.5))
    assert narrow.manoeuvre.size > wide.manoeuvre.size
    assert narrow.sizes < wide.sizes  # of straight pull-outs: 18.90, 19.45 m


@pytest.mark.slow
@pytest.mark.parametrize("legs", [nightly(1), 3])
def test_a_half_turn_between_walls_is_no_worse(legs: int) -> None:
    vehicle, options = load_vehicle("citaro"), SiteOptions(width=23.0 if legs == 1 else 15.5)
    polished, found = (reversing(vehicle, Template.THREE_POINT, options, starts=1, polish=polish).chosen for polish in (True, False))
    assert (polished.legs, found.legs) == (legs, legs)
    assert found.manoeuvre.size - 0.05 < polished.manoeuvre.size <= found.manoeuvre.size  # arcs at full lock are best there


@pytest.mark.parametrize("made", ["worse", "none"])
def test_the_generator_s_answer_is_kept_where_it_is_better(monkeypatch: pytest.MonkeyPatch, made: str) -> None:
    def polish(*given: object) -> Draft | None:
        draft = given[2]
        assert isinstance(draft, Draft)
        return None if made == "none" else Draft(draft.start, draft.lengths + np.array([2.0, 0.0, 0.0]), draft.kappas, draft.leg)

    found = docked("tractor-semitrailer", Template.DOCK_90, polish=False)
    monkeypatch.setattr(answering, "polished", polish)
    kept = reversing(found.vehicle, found.template, found.options, starts=1)
    assert kept.chosen.manoeuvre.size == found.chosen.manoeuvre.size
    assert not kept.chosen.polished


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vehicle", "template", "options", "gain"),
    [
        (refuse(), Template.HAMMERHEAD, SiteOptions(overhang=0.6), 0.7),
        nightly(load_vehicle("WB-62"), Template.DOCK_45, SiteOptions(door_spacing=4.5), 2.5),
        nightly(load_vehicle("WB-40"), Template.DOCK_45, SiteOptions(door_spacing=5.5), 0.5),
    ],
    ids=["hammerhead", "WB-62", "WB-40"],
)
def test_where_rows_of_corners_are_passed_more_room_is_kept_until_none_is_lacking(
    vehicle: Vehicle, template: Template, options: SiteOptions, gain: float
) -> None:  # fmt: skip
    chosen = reversing(vehicle, template, options, starts=4).chosen  # a dock needs no start
    assert chosen.polished
    assert chosen.sizes[0] - chosen.manoeuvre.size > gain  # measured: 0.80, 3.21, 1.00 m
    assert chosen.manoeuvre.lacking == 0.0
