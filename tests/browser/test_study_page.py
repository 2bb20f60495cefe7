"""The map of a study in a real browser, without a network."""

from __future__ import annotations

from pathlib import Path

import pytest

from hdvplan.study.conduct import run
from tests.study.conftest import PLACED, InHere

pytest.importorskip("selenium", reason="the extra 'test' installs selenium")
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.select import Select

from tests.browser.test_report_page import browser, logged, pytestmark  # noqa: F401 - a fixture, and who skips


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the map of a lane and a mirrored one, with two vehicles at two widths that are too small for some."""
    folder = tmp_path_factory.mktemp("study")
    (folder / "lane.geojson").write_text(PLACED, encoding="utf-8")
    (folder / "far.geojson").write_text(PLACED.replace("9.52", "9.54"), encoding="utf-8")
    entries = {
        "roads": [str(folder / "*.geojson")],
        "vehicles": ["bus", "tractor-trailer"],
        "half_widths": [1.4, 1.6],
        "settings": {"horizon": 30},
    }
    return run(entries, folder / "out", InHere()).folder / "map.html"


def _rows(page: webdriver.Chrome) -> list[list[str]]:
    rows = page.find_elements(By.CSS_SELECTOR, "#places tbody tr")
    return [[cell.text for cell in row.find_elements(By.TAG_NAME, "td")] for row in rows]


def test_filters_hold_for_the_table_and_nothing_is_asked_of_a_network(browser: webdriver.Chrome, page_file: Path) -> None:  # noqa: F811
    browser.get("about:blank")
    for log in ("browser", "performance"):
        logged(browser, log)  # what came before
    browser.get(page_file.as_uri())
    every = _rows(browser)
    assert len(every) > 2
    widths = Select(browser.find_element(By.NAME, "width"))
    widths.select_by_visible_text("± 1.6 m")
    narrower = _rows(browser)
    assert {row[5] for row in narrower} == {"± 1.6 m"}
    assert 0 < len(narrower) < len(every)
    widths.select_by_index(0)
    words = browser.find_element(By.NAME, "words")
    words.send_keys("far")
    assert {row[6] for row in _rows(browser)} == {"far"}
    words.send_keys(Keys.CONTROL, "a", Keys.DELETE)
    assert _rows(browser) == every
    assert logged(browser, "browser") == []
    assert not [entry for entry in logged(browser, "performance") if '"url":"http' in str(entry["message"])]


def test_a_table_sorts_and_a_place_is_shown_where_it_is(browser: webdriver.Chrome, page_file: Path) -> None:  # noqa: F811
    browser.get(page_file.as_uri())
    head = browser.find_element(By.CSS_SELECTOR, '#places th[data-by="widening_m"]')
    head.click()
    head.click()
    depths = [float(row[1]) for row in _rows(browser)]
    assert depths == sorted(depths, reverse=True)
    browser.find_element(By.CSS_SELECTOR, "#places tbody tr").click()
    readout = browser.find_element(By.CLASS_NAME, "readout").text
    assert f"{depths[0]:.2f} m lacking" in readout
    assert browser.find_elements(By.CSS_SELECTOR, "#places tbody tr.chosen")
    middle = browser.execute_script(
        "const c = document.querySelector('canvas'), r = window.devicePixelRatio || 1;"
        "return [...c.getContext('2d').getImageData(c.width / 2, c.height / 2, 1, 1).data]"
    )
    assert middle[0] > middle[1] + 60  # the place's red dot is in the middle of the map
