"""The report on paper and on a phone, in a real browser."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from io import BytesIO

import numpy as np
import pytest
from pypdf import PdfReader
from selenium import webdriver

from hdvplan.answers import NEEDS, NO
from hdvplan.judging.result import Result
from hdvplan.report.files import write_plan
from hdvplan.report.html import write_report
from tests.browser.test_report_page import browser, pytestmark, settled  # noqa: F401 - a fixture, and when it runs
from tests.report.conftest import kerbed, long, trailer  # noqa: F401 - fixtures
from tests.report.pdf import strokes

A4_PT = (595.0, 842.0)
DENSITIES = "[...document.querySelectorAll('canvas')].map((c) => [c.width / c.clientWidth, c.height / c.clientHeight])"
PAPER_PX = 703  # A4 less two margins of 12 mm, in pixels of 1/96 inch


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory, kerbed: Result, trailer: Result, long: Result) -> str:  # noqa: F811
    """Three plans in one page, which has columns for them on a wide screen."""
    root = tmp_path_factory.mktemp("printed")
    folders = [root / name for name in ("kerbed", "trailer", "long")]
    for result, folder in zip((kerbed, trailer, long), folders, strict=True):
        write_plan(result, folder)
    write_report(folders, root / "report.html", title="Three plans")
    return (root / "report.html").as_uri()


@pytest.fixture
def phone(browser: webdriver.Chrome, report: str) -> Iterator[webdriver.Chrome]:  # noqa: F811
    """The report on a screen of 390 by 844 at three pixels a pixel."""
    screen = {"width": 390, "height": 844, "deviceScaleFactor": 3, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
    browser.get(report)
    settled(browser)
    yield browser
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def printed(browser: webdriver.Chrome, report: str) -> PdfReader:  # noqa: F811
    browser.get(report)
    settled(browser)
    wanted = {"printBackground": True, "preferCSSPageSize": True}
    answer = browser.execute_cdp_cmd("Page.printToPDF", wanted)
    return PdfReader(BytesIO(base64.b64decode(answer["data"])))


def test_the_report_prints_on_whole_pages(browser: webdriver.Chrome, report: str) -> None:  # noqa: F811
    pdf = printed(browser, report)
    text = " ".join(word for page in pdf.pages for word in page.extract_text().split())  # lines break where they must
    for words in (
        "Three plans",
        "bus on uturn",
        "tractor-trailer on roundabout",
        "bus on long",
        f"bus on uturn {NO} ",
        NEEDS,
        "limit violation",
        "width between limits",
    ):
        assert words in text
    for page in pdf.pages:
        assert [float(page.mediabox.width), float(page.mediabox.height)] == pytest.approx(A4_PT, abs=1.0)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    paper = {"width": PAPER_PX, "height": 1032, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", paper)
    try:
        assert browser.execute_script("return document.documentElement.scrollWidth;") <= PAPER_PX  # nothing is cut off
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


def test_x_and_y_have_one_scale_on_paper(browser: webdriver.Chrome, report: str, kerbed: Result) -> None:  # noqa: F811
    """Buses along the U-turn point everywhere, and are as long and as wide as buses are, with square corners."""
    pdf = printed(browser, report)
    (at,) = (number for number, page in enumerate(pdf.pages) if "bus on uturn" in page.extract_text())
    corners = np.array([line[:4] for line in strokes(pdf.pages[at]) if len(line) == 5])  # the last closes it
    along, across = corners[:, 1] - corners[:, 2], corners[:, 0] - corners[:, 1]
    ratio = np.hypot(*along.T) / np.hypot(*across.T)
    bus_unit = kerbed.drive.vehicle.lead
    buses = np.abs(ratio - bus_unit.length / bus_unit.width) < 0.02  # coordinates have three digits on 20 points
    square = np.abs(np.sum(along * across, axis=1)) / (np.hypot(*along.T) * np.hypot(*across.T))
    directions = np.rad2deg(np.arctan2(along[buses, 1], along[buses, 0]))
    assert np.sum(buses) >= 5
    assert np.ptp(directions) > 60.0
    assert np.max(square[buses]) < 0.01


def test_a_phone_shows_verdict_and_map_first_without_scrolling_sideways(phone: webdriver.Chrome) -> None:
    wide, shown = phone.execute_script("return [document.documentElement.scrollWidth, window.innerWidth];")
    assert wide <= shown == 390
    box = "const b = document.querySelector(arguments[0]).getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom];"
    verdict, plane, summary = (phone.execute_script(box, place) for place in (".verdict", ".plane", "#summary"))
    assert verdict[3] <= plane[1] < plane[3] <= 844.0  # both on the first screen, in this order
    assert summary[1] > plane[3]
    assert plane[0] >= 0.0
    assert plane[2] <= 390.0


def test_canvases_have_a_pixel_for_every_pixel_of_the_screen(phone: webdriver.Chrome) -> None:
    sides = phone.execute_script(f"return {DENSITIES};")
    np.testing.assert_allclose(sides, 3.0, rtol=0.01)  # sides are whole pixels


def test_after_printing_the_screen_is_as_it_was(browser: webdriver.Chrome, report: str) -> None:  # noqa: F811
    printed(browser, report)
    settled(browser)
    ratio, sides = browser.execute_script(f"return [devicePixelRatio, {DENSITIES}];")
    np.testing.assert_allclose(sides, ratio, rtol=0.01)
