from __future__ import annotations

from dataclasses import replace
from io import BytesIO

import pytest
from pypdf import PdfReader

from hdvplan.api import plan
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.result import Result
from hdvplan.need.answer import Need
from hdvplan.need.land import around, on_kerbs
from hdvplan.need.search import on_road
from hdvplan.need.widening import Widening, Widenings
from hdvplan.report.atlas import need_figure
from hdvplan.report.layers import Layer
from hdvplan.report.needs import _sheet, need_features, shown_plan
from hdvplan.report.paper import SheetOptions
from tests.need.test_room import BUS, case_on, least_in_the_bend

ASKED_M, LEFT_M = 0.25, 0.06  # room that is asked for, and that the plan leaves to the present kerb


def need_where(room: float) -> Need:
    """Return the need on a straight whose right kerb has to move, which leaves this ``room``, less than the clearance asked for."""
    case = case_on([0.0, 60.0], [0.0, 0.0])
    case = replace(case, road=case.road.with_limits(3.0, 0.5 * BUS.width + room), settings=replace(case.settings, clearance=ASKED_M))
    own = on_road(plan(replace(case, road=case.road.with_limits(3.0, 3.0))), case.road)
    kerbs, patches = around(own, ("right",))
    widening = Widening(patches, own, on_road(own, on_kerbs(case.road, kerbs)))
    return Need(case, None, least_in_the_bend(), None, None, Widenings(widening, widening, None))


@pytest.fixture(scope="module")
def need() -> Need:
    return need_where(LEFT_M)


def sheet_text(need: Need, shown: Result) -> str:
    return " ".join(page.extract_text() for page in PdfReader(BytesIO(_sheet(need, shown, SheetOptions("a3")))).pages)


def test_drawings_tell_the_room_to_the_kerbs_as_widened(need: Need) -> None:
    """Beside the area to be widened stood what the plan leaves to the present kerb: to a client it is what remains."""
    shown = shown_plan(need)
    assert shown is not None
    assert shown.balance.min_clearance == pytest.approx(LEFT_M, abs=1e-3)
    told = [float(one.properties["clearance_m"] or 0.0) for one in need_features(need, shown) if one.layer is Layer.CLEARANCE]
    assert told
    assert min(told) > ASKED_M - KEPT_M
    text = sheet_text(need, shown)
    assert f"clearance {ASKED_M:.2f} m" in text
    assert f"clearance {LEFT_M:.2f} m" not in text


def test_a_sheet_enlarges_the_kerb_that_is_to_be_cut() -> None:
    need = need_where(-LEFT_M)
    shown = shown_plan(need)
    assert shown is not None
    assert f"{LEFT_M:.2f} m beyond" in sheet_text(need, shown)


def test_the_size_of_a_widening_is_written_on_its_side_of_the_road(need: Need) -> None:
    shown = shown_plan(need)
    assert shown is not None
    figure = need_figure(shown, need_features(need, shown), ["NO"], 0.0, fits=False)
    figure.draw_without_rendering()
    written = [text for axes in figure.axes for text in axes.texts if text.get_text().endswith(" m²")]
    assert written
    assert all(text.get_position()[1] < -0.5 * BUS.width for text in written)  # a bus on y = 0
