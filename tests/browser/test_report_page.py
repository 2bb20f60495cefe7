"""The report in a real browser, without a network."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import shapely

from hdvplan.answers import NO
from hdvplan.judging.result import Result, result_of
from hdvplan.report.files import write_plan
from hdvplan.report.html import write_report
from hdvplan.road.regions import Kind, Region
from tests.report.conftest import bus, kerbed, straight, trailer  # noqa: F401 - fixtures

pytest.importorskip("selenium", reason="the extra 'test' installs selenium")
from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement

CHROMIUM = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None)
DRIVER = shutil.which("chromedriver")
pytestmark = [  # of all tests in a browser
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None or DRIVER is None, reason="needs Chromium and chromedriver on the path"),
]
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--window-size=1500,1300", "--host-resolver-rules=MAP * ~NOTFOUND",
)  # fmt: skip


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory, kerbed: Result, trailer: Result) -> list[Path]:  # noqa: F811
    """A plan with limits, broken, and one of another vehicle on another road, as files."""
    root = tmp_path_factory.mktemp("plans")
    made = [root / "kerbed", root / "trailer"]
    for result, folder in zip((kerbed, trailer), made, strict=True):
        write_plan(result, folder)
    return made


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    options = Options()
    options.binary_location = str(CHROMIUM)
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    chrome = webdriver.Chrome(options=options, service=Service(str(DRIVER)))
    yield chrome
    chrome.quit()


@pytest.fixture
def page(browser: webdriver.Chrome, folders: list[Path]) -> Iterator[webdriver.Chrome]:
    """The page about both plans, freshly opened; afterwards it must have asked for nothing and complained of nothing."""
    file = folders[0].parent / "report.html"
    write_report(folders, file)
    browser.get("about:blank")
    for log in ("browser", "performance"):
        logged(browser, log)  # what came before
    browser.get(file.as_uri())
    settled(browser)
    yield browser
    assert logged(browser, "browser") == []
    asked = [json.loads(entry["message"])["message"] for entry in logged(browser, "performance")]
    requests = [event["params"] for event in asked if event["method"] == "Network.requestWillBeSent"]
    urls = {request["request"]["url"] for request in requests if request["documentURL"] == file.as_uri()}  # the browser's own page aside
    assert file.as_uri() in urls
    assert urls <= {file.as_uri(), "data:,"}


def logged(page: webdriver.Chrome, kind: str) -> list[dict[str, Any]]:
    """Return what the browser logged since it was last asked."""
    entries: list[dict[str, Any]] = page.get_log(kind)  # type: ignore[no-untyped-call] # as selenium has it
    return entries


def settled(page: webdriver.Chrome) -> None:
    """Wait until everything asked for is drawn: the page draws once a frame."""
    page.execute_async_script("const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(done));")


def shown(page: webdriver.Chrome) -> list[WebElement]:
    return [plan for plan in page.find_elements(By.CSS_SELECTOR, ".plan") if plan.is_displayed()]


def pixels(page: webdriver.Chrome, canvas: WebElement) -> str:
    settled(page)
    return str(page.execute_script("return arguments[0].toDataURL();", canvas))


def reading(plan: WebElement) -> dict[str, float]:
    """Return the numbers that a panel reads out: their names and values."""
    text = plan.find_element(By.CSS_SELECTOR, ".readout").text
    return {name: float(value) for name, value in re.findall(r"([a-z]+) (?:= )?(-?[\d.]+)", text)}


def test_the_page_opens_with_every_plan_drawn(page: webdriver.Chrome, tmp_path: Path) -> None:
    first, second = shown(page)
    assert first.find_element(By.CSS_SELECTOR, ".verdict").text.startswith(NO)
    assert "tractor-trailer" in second.find_element(By.TAG_NAME, "h2").text
    for plan in (first, second):
        for canvas in plan.find_elements(By.TAG_NAME, "canvas"):
            colours = page.execute_script(
                "const c = arguments[0], d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data, seen = new Set();"
                "for (let i = 0; i < d.length; i += 4) seen.add((d[i] << 16) | (d[i + 1] << 8) | d[i + 2]); return seen.size;",
                canvas,
            )
            assert colours > 10  # an empty canvas has one; lines alone bring their shades
    assert page.save_screenshot(str(tmp_path / "report.png"))


def test_pointing_at_the_map_reads_the_numbers_of_that_place(page: webdriver.Chrome, folders: list[Path]) -> None:
    plan = shown(page)[0]
    before = reading(plan)
    canvas = plan.find_element(By.CSS_SELECTOR, ".plane")
    page.execute_script("arguments[0].scrollIntoView({block: 'center'});", canvas)
    ActionChains(page).move_to_element_with_offset(canvas, -150, 100).perform()
    settled(page)
    after = reading(plan)
    assert after["s"] != before["s"]
    profile = pd.read_csv(folders[0] / "profile.csv").set_index("s")
    row = profile.loc[after["s"]]
    # Two printed digits.
    assert after["clearance"] == pytest.approx(row["clearance"], abs=0.006)
    assert after["left"] == pytest.approx(row["left1"], abs=0.006)
    assert after["right"] == pytest.approx(-row["right1"], abs=0.006)


def test_an_articulated_vehicle_reads_its_articulation_along_the_slider(page: webdriver.Chrome, folders: list[Path]) -> None:
    plan = shown(page)[1]
    slider = plan.find_element(By.CSS_SELECTOR, ".along")
    page.execute_script("arguments[0].value = 240; arguments[0].dispatchEvent(new Event('input'));", slider)
    settled(page)
    path = pd.read_csv(folders[1] / "path.csv").set_index("s")
    numbers = reading(plan)
    assert numbers["s"] == 120.0  # samples are 0.5 m apart
    assert numbers["articulation"] == pytest.approx(np.rad2deg(path.loc[120.0]["beta1"]), abs=0.06)  # one printed digit
    assert "clearance" not in numbers  # no limits there


def test_wheel_buttons_and_drag_move_the_map_and_back(page: webdriver.Chrome) -> None:
    plan = shown(page)[0]
    canvas, slider = plan.find_element(By.CSS_SELECTOR, ".plane"), plan.find_element(By.CSS_SELECTOR, ".along")
    page.execute_script("arguments[0].scrollIntoView({block: 'center'});", canvas)

    def look() -> str:
        page.execute_script("arguments[0].value = 100; arguments[0].dispatchEvent(new Event('input'));", slider)  # the pointer moved it
        return pixels(page, canvas)

    looks = [look()]
    plan.find_element(By.CSS_SELECTOR, "[data-do=in]").click()
    looks.append(look())
    ActionChains(page).click_and_hold(canvas).move_by_offset(80, 40).release().perform()
    looks.append(look())
    ActionChains(page).scroll_from_origin(ScrollOrigin.from_element(canvas), 0, -300).perform()
    looks.append(look())
    assert len(set(looks)) == len(looks)  # each move showed something else
    plan.find_element(By.CSS_SELECTOR, "[data-do=fit]").click()
    assert look() == looks[0]


def test_the_buttons_show_one_plan_or_all(page: webdriver.Chrome) -> None:
    buttons = {button.text: button for button in page.find_elements(By.CSS_SELECTOR, "nav button")}
    assert len(buttons) == 3
    page.find_element(By.CSS_SELECTOR, "nav [data-show='1']").click()
    settled(page)
    (only,) = shown(page)
    assert only.get_attribute("data-plan") == "1"
    assert reading(only)["left"] > 0.0
    page.find_element(By.CSS_SELECTOR, "nav [data-show='all']").click()
    settled(page)
    assert len(shown(page)) == 2


def test_a_broken_limit_in_the_table_leads_to_its_place(page: webdriver.Chrome, folders: list[Path]) -> None:
    plan = shown(page)[0]
    summary = json.loads((folders[0] / "summary.json").read_text(encoding="utf-8"))
    deepest = max(summary["breaches"], key=lambda breach: breach["depth_m"])
    row = plan.find_element(By.CSS_SELECTOR, "tr[data-s]")
    page.execute_script("arguments[0].scrollIntoView({block: 'center'});", row)
    row.click()
    settled(page)
    numbers = reading(plan)
    assert numbers["s"] == pytest.approx(deepest["s_deepest"], abs=0.25)  # the nearest sample
    assert numbers["clearance"] < 0.0
    assert "bad" in str(plan.find_element(By.CSS_SELECTOR, ".readout").get_attribute("class"))


def test_obstacles_are_drawn_and_their_table_leads_to_them(
    browser: webdriver.Chrome,
    straight: Result,  # noqa: F811
    tmp_path: Path,
) -> None:
    van, kerb = Region(Kind.OBSTACLE, shapely.box(60.0, 2.0, 66.0, 4.0), "van"), Region(Kind.SWEEPABLE, shapely.box(50.0, -5.0, 70.0, -3.0))
    drawn = []
    for name, regions in (("none", ()), ("kerb", (kerb,)), ("van", (van,))):
        drive = replace(straight.drive, road=replace(straight.drive.road, regions=regions))
        write_plan(result_of(drive, solver="piqp", objective="geometric"), tmp_path / name)
        write_report([tmp_path / name], tmp_path / f"{name}.html")
        browser.get((tmp_path / f"{name}.html").as_uri())
        settled(browser)
        canvas = browser.find_element(By.CSS_SELECTOR, ".plane")
        drawn.append(pixels(browser, canvas))
    assert len(set(drawn)) == 3
    row = browser.find_element(By.XPATH, "//tr[td='van']")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'});", row)
    row.click()
    settled(browser)
    nearest = json.loads((tmp_path / "van" / "summary.json").read_text(encoding="utf-8"))["obstacles"][0]
    (plan,) = shown(browser)
    assert reading(plan)["s"] == pytest.approx(nearest["s_m"], abs=0.25)  # the nearest sample
    assert logged(browser, "browser") == []
