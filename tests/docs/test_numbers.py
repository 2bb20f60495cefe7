"""The numbers of README and docs are those of the tables in results."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture
def numbers(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    return importlib.import_module("document_numbers")


def test_every_number_of_the_documents_is_that_of_its_table(numbers: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert numbers.main(["--check"]) == 0, capsys.readouterr().out


def test_numbers_are_put_where_the_sentence_has_them_however_its_lines_break(numbers: ModuleType) -> None:
    figure = numbers.Figure("some.md", "it takes {} ms for the bus, {} more for others.", lambda: ["0.2", "0.15"])
    assert numbers.renewed("Fast: it takes 0.13 ms for\nthe bus, 0.1 more for others. So.", figure) == (
        "Fast: it takes 0.2 ms for\nthe bus, 0.15 more for others. So."
    )


def test_a_number_at_the_end_of_a_sentence_is_taken_whole(numbers: ModuleType) -> None:
    figure = numbers.Figure("some.md", "against {}", lambda: ["5.7"])
    assert numbers.renewed("0.78 against 5.69\n([table])", figure) == "0.78 against 5.7\n([table])"


@pytest.mark.parametrize("text", ["it took 1 s", "it takes 1 s and it takes 2 s"])
def test_a_sentence_that_is_not_there_once_is_refused(numbers: ModuleType, text: str) -> None:
    figure = numbers.Figure("some.md", "it takes {} s", lambda: ["3"])
    with pytest.raises(ValueError, match=r"some\.md: found [02] times"):
        numbers.renewed(text, figure)
