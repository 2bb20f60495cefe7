"""Make notebooks of pages in docs/, run: their blocks as cells, and the pictures of their plans. Needs `pip install nbclient ipykernel`.

python benchmarks/notebooks.py [NAME ...]

tests/docs/test_numbers.py holds the cells to what the pages say.
"""

from __future__ import annotations

import argparse
import os
import re
import tempfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from tests.docs.blocks import FENCE, Block, blocks_of

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "notebooks"
NOTEBOOKS = {  # from which heading of which page on, to the next one of its kind
    "tutorial": ("tutorial.md", "# Your own road"),
    "own-vehicle": ("extending.md", "## A vehicle"),
    "own-solver": ("extending.md", "## A solver"),
}
_PICTURE = """from PIL import Image

picture = Image.open("{folder}/plan.png")
picture.thumbnail((900, 900))
picture"""
Cell = tuple[str, str]  # markdown or code, and its text


def cells_of(name: str) -> list[Cell]:
    """Return the cells of a notebook, from its page."""
    page, heading = NOTEBOOKS[name]
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    text = text[text.index(f"{heading}\n") :]
    level = heading.split()[0]
    text = text[: next((match.start() for match in re.finditer(rf"^{level} ", text, re.MULTILINE) if match.start() > 0), None)]
    prose, blocks = FENCE.split(text)[:: 1 + FENCE.groups], blocks_of(text)
    cells = [("markdown", f"*Made by `benchmarks/notebooks.py` of [{page}](../{page}).*\n\n{_linked(prose[0])}")]
    for block, after in zip(blocks, prose[1:], strict=True):
        cells += [*_cells(block), ("markdown", _linked(after))]
    return [(kind, source.strip()) for kind, source in cells if source.strip()]


def _linked(prose: str) -> str:
    """Return prose whose links lead from the notebooks' folder."""
    return re.sub(r"\]\((?![a-z]+:|#)", "](../", prose)


def _cells(block: Block) -> Iterator[Cell]:
    commands = [line for line in block.body.splitlines() if line.startswith("hdvplan")]
    if block.file is not None:
        yield "code", f"%%writefile {block.file}\n{block.body}"
        if block.language == "python":
            yield "code", f"%run {block.file}"
    elif block.language == "python":
        yield "code", block.body
    elif block.language == "sh" and commands:
        yield "code", "\n".join(["%%bash --no-raise-error", *commands])
        for folder in (folder for command in commands for folder in re.findall(r"hdvplan plan .*--out (\S+)", command)):
            yield "code", _PICTURE.format(folder=folder)
    elif "output" not in block.words:
        yield "markdown", f"```{block.language}\n{block.body}```"


def main() -> None:
    """Make and run."""
    nbformat, nbclient = import_module("nbformat"), import_module("nbclient")  # the test needs the cells alone

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", choices=[[], *NOTEBOOKS], help="which ones [default: all]")
    os.environ["COLUMNS"] = "100"
    FOLDER.mkdir(exist_ok=True)
    for name in parser.parse_args().names or NOTEBOOKS:
        cell = {"markdown": nbformat.v4.new_markdown_cell, "code": nbformat.v4.new_code_cell}
        notebook = nbformat.v4.new_notebook(cells=[cell[kind](source) for kind, source in cells_of(name)])
        for number, one in enumerate(notebook.cells):
            one["id"] = f"{name}-{number}"
        with tempfile.TemporaryDirectory() as folder:
            nbclient.NotebookClient(notebook, timeout=600, coalesce_streams=True, resources={"metadata": {"path": folder}}).execute()
        nbformat.write(notebook, FOLDER / f"{name}.ipynb")
        print(FOLDER / f"{name}.ipynb")


if __name__ == "__main__":
    main()
