from __future__ import annotations

from time import process_time

import pytest

from hdvplan.road.scenarios import shipped
from hdvplan.texts import did_you_mean, meant_by
from hdvplan.vehicle.load import preset_names

NAMES = ["bus", "articulated-bus", "tractor-trailer", "tractor-trailer-24m", "tractor-semitrailer", "WB-62"]


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("buss", ["bus"]),
        ("sub", []),  # two letters of three
        ("tractor-trialer", ["tractor-trailer"]),  # neighbours exchanged
        ("tractor_trailer", ["tractor-trailer"]),
        ("tractor-trailer-25m", ["tractor-trailer-24m"]),
        ("wb-26", ["WB-62"]),
        ("semitrailer", ["tractor-semitrailer"]),  # a part of one name
        ("trailer", ["tractor-trailer", "tractor-trailer-24m", "tractor-semitrailer"]),
        ("tram", []),
        ("x", []),
        ("", []),
    ],
)
def test_only_what_is_near_or_contains_the_name_may_be_meant(name: str, meant: list[str]) -> None:
    assert meant_by(name, NAMES) == meant


def test_names_that_share_only_a_beginning_are_not_meant() -> None:
    assert meant_by("goteborg_xyz", shipped()) == []
    assert meant_by("goteborg", shipped()) == []  # a part of more names than a hint can show
    assert meant_by("goteborg_nya_alen", shipped()) == ["goteborg_nya_allen"]


@pytest.mark.parametrize("name", preset_names())
def test_a_preset_with_one_wrong_letter_is_found(name: str) -> None:
    wrong = name[:-1] + ("x" if name[-1] != "x" else "y")
    if len(name) > 2:  # shorter names have no letters that are right often enough
        assert name in meant_by(wrong, preset_names())


def test_a_hint_names_all_that_may_be_meant_and_else_says_the_other_text() -> None:
    assert did_you_mean("buss", NAMES, "names: ...") == "did you mean 'bus'?"
    assert (
        did_you_mean("wb-64", ["WB-62", "WB-65", "WB-67", "WB-40"], "...") == "did you mean 'WB-62' or 'WB-65' or 'WB-67'?"
    )  # of three at most
    assert did_you_mean("ship", NAMES, "names: ...") == "names: ..."


def test_a_name_of_a_megabyte_is_compared_to_none() -> None:
    began = process_time()
    assert meant_by("x" * 1_000_000, NAMES) == []
    assert process_time() - began < 5.0  # takes a millisecond; letter by letter it took a minute
