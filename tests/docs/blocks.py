"""Read the fenced code blocks of a Markdown document, and run them as its reader would.

The word after the fence is the language; words after it say what the block is for:

    ```sh                   commands; ``hdvplan ... > file`` and a last ``# exit code 1`` are understood
    ```python               a program; all of a document share their names
    ```json file=a.geojson  a file that later blocks read; a program is run, too
    ```text output          what the block before prints: each line is part of one of its lines, ... stands for anything
    ```sh no-run            not run here: installation, measurements of minutes
    ```sh slow              run with the slow tests only
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent

from hdvplan.cli.app import run

FENCE = re.compile(r"^(?P<indent> *)```(?P<info>[^`\n]*)\n(?P<body>.*?)^(?P=indent)```$", re.DOTALL | re.MULTILINE)  # also in a list
_EXIT = re.compile(r"#\s*exit code (?P<codes>\d(?:(?:, | or )\d)*)")


@dataclass(frozen=True)
class Block:
    """One fenced block: its language, what stands after it, its text, and the line where it begins."""

    language: str
    words: tuple[str, ...]
    body: str
    line: int

    @property
    def file(self) -> str | None:
        """The file that the block is, or None."""
        return next((word.removeprefix("file=") for word in self.words if word.startswith("file=")), None)


def blocks_of(text: str) -> list[Block]:
    """Return the fenced blocks of a document in their order."""
    found = []
    for match in FENCE.finditer(text):
        language, *words = match["info"].split() or [""]
        found.append(Block(language, tuple(words), dedent(match["body"]), text.count("\n", 0, match.start()) + 1))
    return found


class Reader:
    """Runs a document's blocks in order in the working directory, and remembers what was printed last."""

    def __init__(self) -> None:
        self._names: dict[str, object] = {"__name__": "__main__"}
        self._printed = ""

    def run(self, block: Block) -> None:
        """Write, run or compare a block; AssertionError says what did not happen as the document has it."""
        if block.file is not None:
            Path(block.file).write_text(block.body, encoding="utf-8")
        if "output" in block.words:
            printed = [_plain(line) for line in self._printed.splitlines()]
            for line in filter(None, map(_plain, block.body.splitlines())):
                pattern = re.compile(".*".join(re.escape(part) for part in line.split("...")))
                assert any(map(pattern.search, printed)), f"line {block.line}: no printed line reads {line!r} in:\n{self._printed}"
        elif block.language == "python":
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile(block.body, f"block at line {block.line}", "exec"), self._names)  # noqa: S102 - our own documents
            self._printed = out.getvalue()
        elif block.language == "sh":
            commands = block.body.replace("\\\n", " ").splitlines()
            self._printed = "".join(_command(line, block.line) for line in commands if line.strip() and not line.startswith("#"))


def runnable(block: Block) -> bool:
    """Tell whether running a block does anything."""
    return "no-run" not in block.words and (block.file is not None or "output" in block.words or block.language in {"sh", "python"})


def _command(line: str, where: int) -> str:
    """Run one command of hdvplan and return what it printed."""
    codes = _EXIT.search(line)
    expected = {int(code) for code in re.findall(r"\d", codes["codes"])} if codes else {0}
    program, *arguments = shlex.split(line, comments=True)
    assert program == "hdvplan", f"line {where}: {program} is no command of ours; mark the block no-run"
    target = None
    if ">" in arguments:
        *arguments, sign, target = arguments
        assert sign == ">"
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = run(arguments)
    assert code in expected, f"line {where}: `{line}` exits with {code}:\n{err.getvalue()}"
    if target is not None:
        Path(target).write_text(out.getvalue(), encoding="utf-8")
        return ""
    return out.getvalue() + err.getvalue()


def _plain(text: str) -> str:
    """Return text with every run of blanks as one."""
    return " ".join(text.split())
