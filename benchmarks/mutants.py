"""Change the program by one plausible slip at a time, and tell whether it is caught; exit code 1 where it is not.

python benchmarks/mutants.py [--only NAME...]

Every mutant of mutants.toml is made in a copy of the tree, where benchmarks/reference.py runs over the mutant's ``area``, or pytest its
``tests``: what the reference cannot see.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
MUTANTS: Mapping[str, Mapping[str, str]] = tomllib.loads(Path(__file__).with_name("mutants.toml").read_text(encoding="utf-8"))
_NEEDED = ("hdvplan", "benchmarks", "roads", "tests", "pyproject.toml", "hatch_build.py")


def where_of(mutant: Mapping[str, str]) -> str:
    """Return the area of the reference that must notice a mutant, or the file of tests."""
    return mutant["tests"] if "tests" in mutant else mutant["area"]


def mutated(mutant: Mapping[str, str]) -> str:
    """Return the text of a mutant's file with its change.

    Raises:
        ValueError: the text that it changes does not stand there once.

    """
    text = (ROOT / mutant["file"]).read_text(encoding="utf-8")
    if text.count(mutant["text"]) != 1:
        msg = f"{mutant['file']} has {mutant['text']!r} {text.count(mutant['text'])} times: choose another slip"
        raise ValueError(msg)
    return text.replace(mutant["text"], mutant["to"])


def copied(tree: Path) -> None:
    """Copy what the reference needs into an empty folder."""
    for name in _NEEDED:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tree / name)


def caught(tree: Path, where: str) -> str:
    """Return what notices a change of ``tree`` in an area of the reference, or a file of tests; nothing where nothing does.

    Raises:
        RuntimeError: the reference, or the tests, did not get to their end.

    """
    tests = where.endswith(".py")
    program = ["-m", "pytest", "-qx", "-p", "no:cacheprovider", where] if tests else ["benchmarks/reference.py", "--area", where]
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1", "HDVPLAN_CORE": "baseline"}
    command = [sys.executable, *program]
    ended = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)  # noqa: S603 - ours
    told = re.search(r"^FAILED .*" if tests else r"\d+ moved", ended.stdout, re.MULTILINE)
    if ended.returncode not in {0, 1} or (told is None and (ended.returncode or not tests)):
        msg = f"{where} did not get to its end: {(ended.stderr or ended.stdout).strip().splitlines()[-1:]}"
        raise RuntimeError(msg)
    return told[0] if told is not None and ended.returncode else ""


def compile_core(tree: Path) -> None:
    """Compile the core of ``tree`` as it is now, for any processor, however the compiler warns of what a slip leaves unused."""
    build = "import hatch_build; hatch_build.build(hatch_build.ROOT / 'hdvplan', ('baseline',), strict=False)"
    subprocess.run([sys.executable, "-c", build], cwd=tree, stdout=subprocess.DEVNULL, check=True)  # noqa: S603 - ours


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the mutants one after the other, and print which are caught."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=list(MUTANTS), default=list(MUTANTS), metavar="NAME")
    asked = parser.parse_args(arguments)
    in_c = {name: MUTANTS[name]["file"].endswith((".c", ".h")) for name in asked.only}
    changes = {name: mutated(MUTANTS[name]) for name in sorted(asked.only, key=lambda name: in_c[name])}
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        copied(tree)
        compile_core(tree)
        for where in sorted({where_of(MUTANTS[name]) for name in asked.only}):
            if told := caught(tree, where):
                print(f"error: {where}: {told} without any mutant\nhint: put that right first", file=sys.stderr)
                return 1
        for name, text in changes.items():
            file, where = tree / MUTANTS[name]["file"], where_of(MUTANTS[name])
            kept = file.read_text(encoding="utf-8")
            file.write_text(text, encoding="utf-8")
            if in_c[name]:
                compile_core(tree)
            told = caught(tree, where)
            file.write_text(kept, encoding="utf-8")
            missed += not told
            print(f"{'caught' if told else 'MISSED':<7} {name} ({where}): {told or 'nothing'}", flush=True)
    print(f"{len(changes) - missed} of {len(changes)} caught")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
