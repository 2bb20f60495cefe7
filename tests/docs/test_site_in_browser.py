"""The documentation site in a real browser, read from the disk without a network."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.browser.test_report_page import browser, pytestmark  # noqa: F401 - fixture, and where it is skipped

pytest.importorskip("selenium", reason="the extra 'test' installs selenium")
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.wait import WebDriverWait

PATIENCE_S = 20.0  # for a search of some tenths of a second on a busy machine


def test_a_search_from_the_first_page_finds_the_page_that_explains_a_word(browser: webdriver.Chrome, site: Path) -> None:  # noqa: F811
    browser.get((site / "index.html").as_uri())
    waiting = WebDriverWait(browser, PATIENCE_S)
    field = waiting.until(lambda page: page.find_element(By.CSS_SELECTOR, "input[name=q]"))
    field.send_keys("articulation")
    field.submit()
    # Results appear one after the other: that they begin to appear does not tell that all are there.
    assert waiting.until(lambda page: page.find_elements(By.CSS_SELECTOR, "#search-results li a[href*=extending]"))


def test_a_page_from_the_disk_asks_for_nothing_else(browser: webdriver.Chrome, site: Path) -> None:  # noqa: F811
    browser.get_log("performance")  # type: ignore[no-untyped-call] # as selenium has it
    browser.get((site / "docs" / "gallery.html").as_uri())
    entries = browser.get_log("performance")  # type: ignore[no-untyped-call] # as above
    asked = [json.loads(entry["message"])["message"] for entry in entries]
    addresses = [event["params"]["request"]["url"] for event in asked if event["method"] == "Network.requestWillBeSent"]
    assert addresses
    assert not [address for address in addresses if not address.startswith(("file:", "data:"))]
