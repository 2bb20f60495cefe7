"""The documentation site: every public name is on a page, every document in its contents, and it builds without a warning."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import hdvplan
from hdvplan import study

ROOT = Path(__file__).parents[2]
SITE = ROOT / "docs" / "site"


def test_every_public_name_is_on_a_page() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in SITE.glob("*.md"))
    documented = set(re.findall(r"\.\. auto(?:function|class):: (?:hdvplan\.(?:\w+\.)*)?(\w+)", text))
    documented |= {"HdvplanError"}  # with all errors, by their module
    assert set(hdvplan.__all__) - {"__version__", "study"} <= documented
    assert set(study.__all__) <= documented


def test_every_document_is_in_the_contents() -> None:
    contents = (SITE / "index.md").read_text(encoding="utf-8")
    for path in (ROOT / "docs").glob("*.md"):
        assert re.search(rf"^(?:.* <)?/docs/{path.stem}>?$", contents, flags=re.MULTILINE), f"docs/site/index.md does not list {path.name}"


@pytest.mark.slow
def test_the_address_that_people_open_leads_to_the_first_page(site: Path) -> None:
    (target,) = re.findall(r'url=([^"]+)"', (site / "index.html").read_text(encoding="utf-8"))
    assert "Does my vehicle fit?" in (site / target).read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_gallery_has_every_picture_with_its_command_below(site: Path) -> None:
    pictures = re.findall(r'<img [^>]*src="([^"]+)"', (site / "docs" / "gallery.html").read_text(encoding="utf-8"))
    assert pictures
    for picture in pictures:
        assert (site / "docs" / picture).is_file(), picture
    source = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    assert len(re.findall(r"^!\[[^\]]+\]\([^)]+\)\n\n```sh", source, flags=re.MULTILINE)) == len(
        re.findall(r"^!\[", source, flags=re.MULTILINE)
    )


@pytest.mark.slow
def test_fields_of_public_values_are_explained_with_their_units(site: Path) -> None:
    page = (site / "docs" / "site" / "roads-and-vehicles.html").read_text(encoding="utf-8")
    (explained,) = re.findall(r'id="hdvplan\.Unit\.wheelbase">.*?<dd>(.*?)</dd>', page, flags=re.DOTALL)
    assert "[m]" in explained


@pytest.mark.slow
def test_no_page_loads_anything_from_the_network(site: Path) -> None:
    for page in site.rglob("*.html"):
        tags = re.findall(r"<(?:script|img|iframe|link)\s[^>]*>", page.read_text(encoding="utf-8"))
        loaded = [tag for tag in tags if re.search(r'(?:src|href)="(?:https?:)?//', tag)]
        assert not loaded, f"{page.name} loads {loaded}"
