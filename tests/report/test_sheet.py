"""Sheets, measured in the PDF's own coordinates."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO
from itertools import combinations, pairwise
from typing import cast

import numpy as np
import pytest
import shapely
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from pypdf import PdfReader
from pypdf.generic import DictionaryObject

from hdvplan.answers import NEEDS, NO
from hdvplan.errors import OptionError
from hdvplan.judging.result import Result, result_of
from hdvplan.judging.verdict import verdict_of
from hdvplan.report import sheet
from hdvplan.report.paper import MM_IN, PAPERS_MM, SCALES, STAMP_MM, Page, SheetOptions, layout, pages_of
from hdvplan.report.rooms import room_at
from hdvplan.report.sheet import sheet_bytes, steering_text
from hdvplan.report.sheetmap import draw_field, inset_scale, places_of
from hdvplan.road.regions import Kind, Region
from hdvplan.vehicle.load import load_vehicle
from tests.nightly import nightly
from tests.report.pdf import strokes

FIELD_MM = (290.0, 200.0)
WIDE_MM = (9000.0, 9000.0)


def read(result: Result, paper: str = "a3", scale: int | None = None) -> PdfReader:
    return PdfReader(BytesIO(sheet_bytes(result, SheetOptions(paper, scale))))


@pytest.mark.slow
def test_twenty_metres_are_a_hundred_millimetres_at_1_to_200(bus: Result) -> None:
    (page, *_) = read(bus, "a3", 200).pages
    level = [line for line in strokes(page) if len(line) == 2 and line[0, 1] == line[1, 1]]
    bar = min(level, key=lambda line: abs(line[1, 0] - line[0, 0] - 100.0))  # the scale bar
    assert bar[1, 0] - bar[0, 0] == pytest.approx(100.0, abs=1e-3)  # written to 1e-6 points
    assert "20 m" in page.extract_text()
    assert "1:200" in page.extract_text()


def test_fonts_are_embedded_and_nothing_is_a_picture(kerbed: Result) -> None:
    for page in read(kerbed).pages:
        resources = cast("DictionaryObject", page["/Resources"])  # resolved
        fonts = cast("DictionaryObject", resources["/Font"].get_object())
        assert fonts
        for font in fonts.values():
            described = font.get_object()
            inner = described["/DescendantFonts"][0].get_object() if "/DescendantFonts" in described else described
            assert "/FontFile2" in inner["/FontDescriptor"].get_object()  # TrueType
        pictures = [
            item
            for item in cast("DictionaryObject", resources["/XObject"].get_object()).values()
            if item.get_object()["/Subtype"] == "/Image"
        ]
        assert pictures == []


@pytest.mark.slow
def test_the_title_says_what_a_file_needs(trailer: Result, kerbed: Result) -> None:
    text = " ".join(read(trailer).pages[0].extract_text().split())
    for words in (
        NEEDS,
        "roundabout",
        "tractor-trailer",
        "© the surveyors",
        "hdvplan",
        "direction of travel",
        "wheel tracks",
    ):
        assert words in text
    text = " ".join(read(kerbed).pages[0].extract_text().split())
    assert NO in text
    assert "beyond" in text  # at the enlarged places


def test_the_largest_round_scale_that_fits_is_taken(bus: Result, long: Result) -> None:
    (page,) = pages_of(bus, FIELD_MM, None)
    assert page.scale == 500
    for scale in (200, 250):
        assert len(pages_of(bus, FIELD_MM, scale)) > 1
    parts = pages_of(long, FIELD_MM, None)  # half a kilometre
    assert {part.scale for part in parts} == {500}
    assert parts[0].s_from == 0.0
    assert parts[-1].s_to == long.drive.road.path.length
    for one, other in pairwise(parts):
        assert other.s_from == pytest.approx(one.s_to - 5.0)  # they overlap
    assert parts[0].caption.startswith(f"sheet 1 of {len(parts)}")


def test_of_a_road_too_long_for_sheets_the_tight_stretches_are_drawn(long: Result) -> None:
    pages = pages_of(long, (90.0, 90.0), 200)
    assert len(pages) == 2  # it has two bends
    assert all("only the tightest stretches" in page.caption for page in pages)
    assert pages[0].s_from < 150.0 < pages[0].s_to < pages[1].s_from < 350.0 < pages[1].s_to


def test_a_place_is_enlarged_on_one_sheet_unless_the_next_has_a_tighter_one_beside_it(long: Result) -> None:
    page = Page(0.0, long.drive.road.path.length, 0.0, (0.0, 0.0), 500)
    shown = [room.s for _, room in places_of(long, page, WIDE_MM, 3)]
    again = [room.s for _, room in places_of(long, page, WIDE_MM, 3, shown)]
    assert shown
    assert all(abs(one - other) >= 10.0 for one in shown for other in again)
    (tightest,) = (room.s for _, room in places_of(long, page, WIDE_MM, 1))
    assert places_of(long, page, WIDE_MM, 1, [tightest + 5.0])[0][1].s == tightest  # the first sheet ended on its shoulder


@pytest.mark.parametrize(("x", "scale"), [(-2.5, 500), (-2.5, 250), (84.0, 200)])
def test_what_decides_before_or_behind_the_road_is_on_a_map(straight: Result, x: float, scale: int) -> None:
    post = Region(Kind.OBSTACLE, shapely.Point(x, 1.5).buffer(0.1), "post")
    result = result_of(replace(straight.drive, road=replace(straight.drive.road, regions=(post,))), solver="riccati", objective="geometric")
    pages = pages_of(result, FIELD_MM, scale)
    assert all(0.0 <= page.s_from < page.s_to <= 80.0 for page in pages)
    page = pages[0 if x < 0.0 else -1]
    assert [room.s for _, room in places_of(result, page, FIELD_MM, 1)] == pytest.approx([x])
    aside = replace(page, middle=(page.middle[0] - 100.0 * np.sign(x), page.middle[1]))  # a map that does not show it
    assert all(abs(room.s - x) > 1.0 for _, room in places_of(result, aside, FIELD_MM, 3))


def test_a_scale_without_room_for_the_vehicle_is_refused(bus: Result) -> None:
    with pytest.raises(OptionError, match="no room for the bus"):
        sheet_bytes(bus, SheetOptions("a4", 10))


def test_a_station_s_number_that_a_letter_would_cover_stands_on_the_other_side(straight: Result) -> None:
    narrow = replace(straight.drive, road=straight.drive.road.with_limits(2.0, 3.0))
    result = result_of(narrow, solver="riccati", objective="geometric")
    (page,) = pages_of(result, FIELD_MM, 500)
    room = room_at(result, int(np.argmin(np.abs(result.envelope.s - 40.0))))
    for places, side in (([("A", room)], False), ([], True)):
        axes = Figure().add_subplot()
        draw_field(axes, result, (), page, FIELD_MM, places, tubes=False)
        sides = {
            text.get_text(): text.get_position()[1] > 0.0
            for text in axes.texts
            if text.get_text() in {"0", "20", "40", "60", "80"} and text.get_position()[1] > -20.0
        }
        assert sides == {"0": True, "20": True, "40": side, "60": True, "80": True}


def test_enlarged_places_are_at_least_twice_as_large_as_on_the_map() -> None:
    for scale in (10, 19, 39, *SCALES, 5000):
        assert 2 * inset_scale(Page(0.0, 1.0, 0.0, (0.0, 0.0), scale)) <= scale


def test_options_are_read_as_they_are_written() -> None:
    assert SheetOptions.named("A3", "1:250") == SheetOptions("a3", 250)
    assert SheetOptions.named("a0", None).scale is None
    for paper, scale in (("a5", None), ("a3", "half"), ("a3", "0"), ("a3", "1:99999")):
        with pytest.raises(OptionError):
            SheetOptions.named(paper, scale)


@pytest.mark.slow
def test_enlarged_places_show_what_the_driver_may_err(kerbed: Result, straight: Result) -> None:
    """A fill of three quarters white is the band; a plan that breaks its limits has none, nor what says so."""
    for result, shown in ((straight, True), (kerbed, False)):
        assert verdict_of(result).fits is shown
        (page, *_) = read(result).pages
        contents = page.get_contents()
        assert contents is not None
        assert (b" 0.75 g" in contents.get_data()) is shown
        assert ("with the driver's error, where enlarged" in " ".join(page.extract_text().split())) is shown


@pytest.mark.slow
@pytest.mark.parametrize(("paper", "stamps"), [nightly("a4", 0), ("a4", 6), nightly("a3", 10)])
def test_no_text_lies_on_another_or_beyond_its_frame(
    figures: list[Figure], bus: Result, kerbed: Result, trailer: Result, long: Result, paper: str, stamps: int
) -> None:
    written = tuple((f"number {at}", "an office of consulting engineers and surveyors" * (at % 2)) for at in range(stamps))
    for result in (bus, kerbed, trailer, long):
        sheet_bytes(result, SheetOptions(paper, None, written))
    assert len(figures) >= 4
    for figure in figures:
        figure.canvas.draw()
        for axes in figure.axes:
            frame = axes.get_window_extent()
            texts = [text for text in axes.findobj(Text) if text.get_text() and text.get_visible()]
            drawn = [text for text in texts if not text.get_clip_on() or text.get_window_extent().overlaps(frame)]
            boxes = {text.get_text(): text.get_window_extent() for text in drawn}
            for (one, first), (other, second) in combinations(boxes.items(), 2):
                shared = Bbox.intersection(first, second)
                assert shared is None or min(shared.width, shared.height) < 1.0, f"{one!r} on {other!r}"  # letters have air around them
            for text, box in boxes.items():
                shared = Bbox.intersection(box, frame)
                assert shared is not None
                assert shared.width > box.width - 1.0, f"{text!r} is cut at the frame"
                assert shared.height > box.height - 1.0, f"{text!r} is cut at the frame"


@pytest.mark.parametrize("stamps", [0, 10])
def test_nothing_in_a_title_block_is_cut_whatever_the_paper(monkeypatch: pytest.MonkeyPatch, straight: Result, stamps: int) -> None:
    """On A4 the row of what the driver may err ended in dots."""
    sheets: list[sheet.Sheet] = []

    def kept(shown: sheet.Sheet, _: SheetOptions) -> Figure:
        sheets.append(shown)
        return Figure()

    monkeypatch.setattr(sheet, "_figure", kept)
    sheet_bytes(straight, SheetOptions("a4"))
    (drawn,) = sheets
    assert "; decided at s = " in dict(drawn.rows)["driver"]
    written = tuple((f"number {at}", "an office of consulting engineers and surveyors of the city") for at in range(stamps))
    for paper in PAPERS_MM:
        options, figure = SheetOptions(paper, None, written), Figure()
        box = layout(options)[4]
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        figure.set_size_inches(box.width / MM_IN, box.height / MM_IN)
        sheet._draw_title(axes, drawn, options, (box.width, box.height))
        told = " ".join(text.get_text() for text in axes.texts)
        for words in (drawn.verdict, drawn.details, *(value for _, value in drawn.rows), *(value for _, value in written)):
            assert words in told
        for text in axes.texts:
            frame = text.get_window_extent().transformed(axes.transData.inverted())
            stamp = text.get_position()[1] < STAMP_MM * options.stamp_rows
            assert frame.x1 < box.width
            assert frame.y0 > (0.0 if stamp else STAMP_MM * options.stamp_rows)


def test_the_angle_of_the_front_wheels_stands_beside_their_largest_angle() -> None:
    """It stood beside the share of the curvature: 16 of 49 degrees were 24 %."""
    bus = load_vehicle("bus")
    lock = np.arctan(bus.lead.wheelbase * bus.max_curvature)
    text = steering_text(bus, float(np.tan(0.5 * lock)) / bus.lead.wheelbase, [])
    assert text == f"at most {np.degrees(0.5 * lock):.0f} of {np.degrees(lock):.0f} degrees"


def test_stamps_are_written_and_those_without_a_name_refused(bus: Result) -> None:
    options = SheetOptions.named("a3", None, ["project=Line 18 = new", "checked by="])
    assert options.stamps == (("project", "Line 18 = new"), ("checked by", ""))
    text = PdfReader(BytesIO(sheet_bytes(bus, options))).pages[0].extract_text()
    for words in ("project", "Line 18 = new", "checked by", " degrees"):
        assert words in text
    for stamp in ("project", "=Line 18"):
        with pytest.raises(OptionError, match="is not NAME=TEXT"):
            SheetOptions.named("a3", None, [stamp])
    with pytest.raises(OptionError, match="room for 10 stamps"):
        SheetOptions("a3", None, tuple((str(number), "") for number in range(11)))
