"""Change the program by one plausible slip at a time, and tell whether the behaviour reference catches it; exit code 1 where it does not.

python benchmarks/mutants.py [--only NAME...]

Every mutant of mutants.toml is made in a copy of the tree, where benchmarks/reference.py runs over the mutant's area.
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
_NEEDED = ("hdvplan", "benchmarks", "roads", "pyproject.toml", "hatch_build.py")


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


def moved(tree: Path, areas: Sequence[str]) -> int:
    """Return how many numbers of some areas the reference finds moved in ``tree``.

    Raises:
        RuntimeError: the reference says no number: it did not get to its end.

    """
    command = [sys.executable, "benchmarks/reference.py", "--area", *areas]
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    subprocess.run([sys.executable, "hatch_build.py"], cwd=tree, env=environment, stdout=subprocess.DEVNULL, check=True)
    ended = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)  # noqa: S603 - ours
    said = re.search(r"(\d+) moved", ended.stdout)
    if said is None:
        msg = f"the reference did not get to its end: {(ended.stderr or ended.stdout).strip().splitlines()[-1:]}"
        raise RuntimeError(msg)
    return int(said[1])


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the mutants one after the other, and print which are caught."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=list(MUTANTS), default=list(MUTANTS), metavar="NAME")
    asked = parser.parse_args(arguments)
    changes = {name: mutated(MUTANTS[name]) for name in asked.only}
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        copied(tree)
        before = moved(tree, sorted({MUTANTS[name]["area"] for name in asked.only}))
        if before:
            print(f"error: {before} numbers have moved without any mutant\nhint: python benchmarks/reference.py", file=sys.stderr)
            return 1
        for name, text in changes.items():
            mutant = MUTANTS[name]
            file = tree / mutant["file"]
            kept = file.read_text(encoding="utf-8")
            file.write_text(text, encoding="utf-8")
            count = moved(tree, [mutant["area"]])
            file.write_text(kept, encoding="utf-8")
            missed += not count
            print(f"{'caught' if count else 'MISSED':<7} {name} ({mutant['area']}): {count} numbers moved", flush=True)
    print(f"{len(changes) - missed} of {len(changes)} caught")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
