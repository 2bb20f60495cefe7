"""``hdvplan warm-up``: one cache for all users of an installation."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import Cli

COMMAND = (sys.executable, "-m", "hdvplan")


def test_a_cache_that_would_not_last_is_refused(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    from hdvplan.cachefolders import CacheFolders  # noqa: PLC0415 - beside what it stands in for

    monkeypatch.setattr("hdvplan.jit.cache_folders", lambda: CacheFolders((), None, "compiled code is not kept (the disk is full)"))
    ended = cli("warm-up")
    assert ended.code == 2
    assert ended.err.startswith("error: compiled code is not kept (the disk is full)\nhint: ")


def test_code_that_could_not_be_kept_is_no_success(cli: Cli, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from hdvplan.cachefolders import CacheFolders  # noqa: PLC0415 - beside what it stands in for

    full = "compiled code is not kept (/opt/hdvplan: No space left on device): the next run compiles again"
    monkeypatch.setattr("hdvplan.jit.cache_folders", lambda: CacheFolders((tmp_path,), tmp_path))
    monkeypatch.setattr("hdvplan.cli.warm_up._compile", lambda _: logging.getLogger("hdvplan").warning(full))
    ended = cli("warm-up", "--vehicle", "bus")
    assert (ended.code, ended.out) == (2, "")
    assert f"error: {full}\n" in ended.err


def test_an_unknown_vehicle_is_refused_before_anything_compiles(cli: Cli) -> None:
    ended = cli("warm-up", "--vehicle", "bsu")
    assert (ended.code, ended.out) == (2, "")
    assert ended.err.startswith("error: unknown vehicle 'bsu'\n")


@pytest.mark.slow  # compiles a kind of vehicle: half a minute
def test_after_it_a_plan_compiles_nothing_and_others_may_read_the_cache(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}

    def call(*arguments: str) -> str:
        ended = subprocess.run(  # noqa: S603 - our own
            [*COMMAND, *arguments], cwd=tmp_path, env=environment, umask=0o077, capture_output=True, text=True, check=True
        )
        return ended.stderr

    assert "compiling" in call("warm-up", "--vehicle", "bus")
    kept = sorted(cache.rglob("*"))
    assert sum(path.suffix == ".nbc" for path in kept) > 50
    assert all(path.stat().st_mode & 0o777 == (0o755 if path.is_dir() else 0o644) for path in (cache / "hdvplan").rglob("*"))
    for road in ("uturn", "goteborg_lindholmsallen_uturn"):
        assert call("plan", road, "--vehicle", "citaro", "--no-plot", "--quiet") == ""
    assert sorted(cache.rglob("*")) == kept
