"""Every file that cannot be used is refused with the line that is written down for it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Cli

CORPUS = Path(__file__).parents[1] / "corpus"
EXPECTED: dict[str, str] = json.loads((CORPUS / "expected.json").read_text(encoding="utf-8"))


def test_the_corpus_and_its_answers_are_of_the_same_files() -> None:
    files = {path.relative_to(CORPUS).as_posix() for path in CORPUS.glob("*/*")}
    assert files == set(EXPECTED)
    assert len(files) > 150


@pytest.mark.parametrize("name", EXPECTED)
def test_a_file_that_cannot_be_used_is_refused_in_the_line_that_is_written_down(
    cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    kind, _, file = name.partition("/")
    out = ("--out", str(tmp_path / "out"))
    commands = {
        "roads": ("plan", file, "--vehicle", "bus", "--no-plot", *out),
        "vehicles": ("plan", "uturn", "--vehicle", file, "--no-plot", *out),
        "suites": ("bench", "--suite", file, *out),
        "biases": ("plan", "uturn", "--vehicle", "bus", "--bias", file, "--no-plot", *out),
        "templates": ("turn", "--vehicle", "bus", "--template", file, *out),
        "studies": ("study", file, *out),
    }
    monkeypatch.chdir(CORPUS / kind)
    outcome = cli(*commands[kind])
    assert (outcome.code, outcome.out) == (2, "")
    error = outcome.err.splitlines()[0]
    assert error == EXPECTED[name] or (EXPECTED[name].endswith("...") and error.startswith(EXPECTED[name][:-3]))
    assert [line for line in outcome.err.splitlines()[1:] if not line.startswith("hint: ")] == []
