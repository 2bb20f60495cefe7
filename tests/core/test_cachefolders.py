"""Which folder takes compiled kernels, and which are not to be trusted."""

from __future__ import annotations

import logging
import os
import shutil
from pathlib import Path
from typing import Any

import numba
import pytest

from hdvplan.cachefolders import CacheFolders, find_folders, temporary_folder
from hdvplan.kernelcache import KernelCache

root_only = pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="gives files to another user")
SOMEBODY = 54321


@pytest.fixture(autouse=True)
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let this user's home, and the temporary files, be in the test's folder."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))


def test_the_home_takes_compiled_code_and_nothing_is_said(tmp_path: Path) -> None:
    kept = tmp_path / "home" / ".cache" / "hdvplan" / "code"
    assert find_folders("code") == CacheFolders((kept,), kept, "")
    assert kept.is_dir()


def test_the_folder_that_the_environment_names_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "named"))
    kept = tmp_path / "named" / "hdvplan" / "code"
    assert find_folders("code") == CacheFolders((kept,), kept, "")


def test_a_named_folder_that_cannot_be_written_is_read_and_the_home_takes_what_is_new(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "named"))
    shared, kept = tmp_path / "named" / "hdvplan" / "code", tmp_path / "home" / ".cache" / "hdvplan" / "code"
    shared.mkdir(parents=True)
    monkeypatch.setattr("os.access", lambda path, _mode: Path(path) != shared)  # the administrator may write everywhere
    assert find_folders("code") == CacheFolders((shared, kept), kept, "")


def test_without_a_home_temporary_files_take_it_with_a_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def nobody() -> Path:
        raise RuntimeError

    monkeypatch.setattr("pathlib.Path.home", nobody)
    found = find_folders("code")
    assert found.write == tmp_path / "temporary" / f"hdvplan-{os.geteuid()}" / "code"
    assert found.note == (
        f"compiled code is kept in {found.write.parent} only (there is no home folder); NUMBA_CACHE_DIR names a folder to keep it in"
    )


def test_a_home_that_is_a_file_takes_nothing(tmp_path: Path) -> None:
    (tmp_path / "home").write_text("", encoding="utf-8")
    assert f"only ({tmp_path}/home: File exists)" in find_folders("code").note


def test_a_full_disk_takes_nothing_and_every_run_compiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = shutil.disk_usage(tmp_path)._replace(free=1_000_000)
    monkeypatch.setattr("shutil.disk_usage", lambda _: usage)
    found = find_folders("code")
    assert found.write is None
    assert found.note.startswith(f"compiled code is not kept ({tmp_path}/home/.cache/hdvplan is full): every run compiles; ")


@pytest.mark.parametrize("level", [".", "hdvplan", "hdvplan/code"])
def test_a_folder_into_which_all_may_write_is_neither_read_nor_filled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, level: str) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "open"))
    (tmp_path / "open" / "hdvplan" / "code").mkdir(parents=True)
    (tmp_path / "open" / level).chmod(0o777)
    kept = tmp_path / "home" / ".cache" / "hdvplan" / "code"
    assert find_folders("code") == CacheFolders((kept,), kept, "")


def test_a_folder_in_a_sticky_one_is_safe_and_the_sticky_one_itself_is_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "sticky"))
    (tmp_path / "sticky" / "hdvplan" / "code").mkdir(parents=True)
    (tmp_path / "sticky").chmod(0o1777)
    assert find_folders("code").write == tmp_path / "sticky" / "hdvplan" / "code"
    (tmp_path / "sticky" / "hdvplan" / "code").chmod(0o1777)  # others may add files here
    assert find_folders("code").write == tmp_path / "home" / ".cache" / "hdvplan" / "code"


@root_only
@pytest.mark.parametrize("level", ["", "hdvplan", "hdvplan/code"])
def test_another_user_s_folder_is_neither_read_nor_filled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, level: str) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "theirs"))
    (tmp_path / "theirs" / "hdvplan" / "code").mkdir(parents=True)
    os.chown(tmp_path / "theirs" / level, SOMEBODY, SOMEBODY)
    kept = tmp_path / "home" / ".cache" / "hdvplan" / "code"
    assert find_folders("code") == CacheFolders((kept,), kept, "")


@root_only
def test_another_user_s_link_to_a_folder_of_ours_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "ours").mkdir()
    link = tmp_path / "temporary" / f"hdvplan-{os.geteuid()}"
    link.symlink_to(tmp_path / "ours")
    assert temporary_folder("code") == link / "code"
    os.chown(link, SOMEBODY, SOMEBODY, follow_symlinks=False)
    assert temporary_folder("code") is None


def one_more(value: float) -> float:
    """Stand for a kernel."""
    return value + 1.0


def kernel(folders: CacheFolders) -> Any:  # noqa: ANN401 - numba has no types
    """Return ``one_more`` compiled anew, as another process would."""
    made: Any = numba.njit(one_more)
    made._cache = KernelCache(one_more, folders)
    return made


def test_code_is_found_again_in_any_of_the_folders(tmp_path: Path) -> None:
    shared, own = tmp_path / "shared", tmp_path / "own"
    shared.mkdir()
    own.mkdir()
    first = kernel(CacheFolders((shared,), shared))
    assert first(1.0) == 2.0
    assert (sum(first._cache_hits.values()), sum(first._cache_misses.values())) == (0, 1)
    second = kernel(CacheFolders((shared, own), own))
    assert second(1.0) == 2.0
    assert (sum(second._cache_hits.values()), sum(second._cache_misses.values())) == (1, 0)
    assert list(own.iterdir()) == []


def test_damaged_code_is_compiled_once_more_and_replaced(tmp_path: Path) -> None:
    folders = CacheFolders((tmp_path,), tmp_path)
    kernel(folders)(1.0)
    (code,) = tmp_path.rglob("*.nbc")
    code.write_bytes(code.read_bytes()[:100])
    assert kernel(folders)(1.0) == 2.0
    again = kernel(folders)
    assert again(1.0) == 2.0
    assert sum(again._cache_hits.values()) == 1


def test_where_nothing_can_be_kept_kernels_run_and_the_library_logs_why_once(caplog: pytest.LogCaptureFixture) -> None:
    folders = CacheFolders((), None, "no folder at all")
    assert kernel(folders)(1.0) == 2.0
    assert kernel(folders)(1.0) == 2.0
    assert caplog.record_tuples == [("hdvplan", logging.WARNING, "no folder at all")]


def test_a_disk_that_fills_up_costs_the_code_and_not_the_run(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    full = CacheFolders((tmp_path,), tmp_path / "gone" / "hdvplan")  # any failure of the disk: here its folder is gone
    assert kernel(full)(1.0) == 2.0
    assert caplog.messages == [f"compiled code is not kept ({tmp_path}/gone: No such file or directory): the next run compiles again"]
