"""The notebooks say and run what their pages do."""

from __future__ import annotations

import importlib
import json
from pathlib import Path

import pytest


@pytest.mark.parametrize("name", ["tutorial", "own-vehicle", "own-solver"])
def test_a_notebook_is_its_page_and_has_been_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    notebooks = importlib.import_module("notebooks")
    cells = json.loads((notebooks.FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
    assert [(cell["cell_type"], "".join(cell["source"])) for cell in cells] == notebooks.cells_of(name)
    assert all(cell["execution_count"] for cell in cells if cell["cell_type"] == "code")
    assert any("image/png" in output.get("data", {}) for cell in cells for output in cell.get("outputs", ()))
