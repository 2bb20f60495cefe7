"""Kill the timing gate at random moments, and look for what it leaves: processes, temporary files, worktrees, half-made environments.

A small repository with a package of its own is compared with its last commit: revisions are exported, environments built, a command is
run in both. Every run starts with an empty cache and is ended by SIGTERM or SIGINT between its first moment and the time that a whole
run takes. Exits with 1 if anything is left. Linux only: what runs is read from /proc.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from gate_patches import make_repository

TOKEN = "HDVPLAN_GATE_KILLS"  # a variable that all processes of a run inherit  # noqa: S105 - no password
PROJECT = """
[build-system]
requires = []
build-backend = "backend"
backend-path = ["."]

[project]
name = "planner-of-ours"
version = "1.0"
"""
BACKEND = """
import zipfile


def build_wheel(folder, config=None, metadata=None):
    name = "planner_of_ours-1.0-py3-none-any.whl"
    with zipfile.ZipFile(f"{folder}/{name}", "w") as wheel:
        wheel.write("ours.py")
        about = "planner_of_ours-1.0.dist-info/"
        wheel.writestr(about + "METADATA", "Metadata-Version: 2.1\\nName: planner-of-ours\\nVersion: 1.0\\n")
        wheel.writestr(about + "WHEEL", "Wheel-Version: 1.0\\nGenerator: ours\\nRoot-Is-Purelib: true\\nTag: py3-none-any\\n")
        wheel.writestr(about + "RECORD", "")
    return name
"""
OURS = """
import json, subprocess, sys, time

subprocess.run([sys.executable, "-c", "import time; time.sleep(0.1)"])
print(json.dumps({"cells": {"depot": [0.001, 0.0011, 0.0012]}}))
"""


def gate(top: Path, folder: Path, token: str) -> subprocess.Popen[str]:
    """Start a comparison of the repository with its last commit."""
    variables = {TOKEN: token, "TMPDIR": str(folder / "temporary"), "XDG_CACHE_HOME": str(folder / "cache")}
    command = ["-P", "-m", "hdvplan", "bench", "--against", "HEAD", "--command", "python -m ours", "--out", str(folder / "out")]
    return subprocess.Popen(  # noqa: S603 - our own
        [sys.executable, *command], cwd=top, env=os.environ | variables, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )


def left_behind(top: Path, folder: Path, token: str) -> list[str]:
    """Return what is left of a run, in words."""
    found = [f"process {path.name}" for path in Path("/proc").iterdir() if path.name.isdigit() and _has(path, token)]
    found += [f"temporary {path.name}" for path in (folder / "temporary").iterdir()]
    trees = subprocess.run(["git", "-C", str(top), "worktree", "list"], capture_output=True, text=True, check=True)  # noqa: S603, S607 - fixed
    found += [] if len(trees.stdout.splitlines()) == 1 else ["a worktree"]
    kept = folder / "cache" / "hdvplan" / "gate"
    return found + [f"unfinished {path.name}" for path in kept.glob("*") if path.is_dir() and not (path / "ready").is_file()]


def _has(process: Path, token: str) -> bool:
    try:
        return f"{TOKEN}={token}".encode() in (process / "environ").read_bytes().split(b"\0")
    except OSError:
        return False


def main() -> int:
    """Time one whole run, then kill others; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=20, metavar="N")
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    asked = parser.parse_args()
    moments = random.Random(asked.seed)  # noqa: S311 - not for secrets
    bad = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        top = folder / "repository"
        make_repository(top, {"pyproject.toml": PROJECT, "backend.py": BACKEND, "ours.py": OURS})
        whole = 0.0
        for kill in range(asked.kills + 1):
            for past in ("cache", "temporary"):
                shutil.rmtree(folder / past, ignore_errors=True)
            (folder / "temporary").mkdir(exist_ok=True)
            token, number = f"{os.getpid()}-{kill}", (signal.SIGTERM, signal.SIGINT)[kill % 2]
            began, moment = time.monotonic(), moments.uniform(0.0, whole)
            process = gate(top, folder, token)
            with process:
                if kill:
                    time.sleep(moment)
                    process.send_signal(number)
                _, said = process.communicate()
            whole = whole if kill else time.monotonic() - began
            time.sleep(0.2)  # what was killed needs a moment to be gone
            found = left_behind(top, folder, token)
            what = f"{number.name} after {moment:.1f} s" if kill else f"a whole run, {whole:.1f} s"
            last = (said.strip().splitlines() or ["nothing"])[-1]
            print(f"{what}: ended with {process.returncode}, {last!r}; {'; '.join(found) or 'nothing left'}", flush=True)
            bad += bool(found)
    print(f"{asked.kills} kills, {bad} left something")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
