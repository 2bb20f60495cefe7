"""Which temporary folder is this user's, and which are not to be trusted."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from hdvplan.process import temporary_folder

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="on Windows each user's temporary files are closed to others")
root_only = pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="gives files to another user")
SOMEBODY = 54321


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let the temporary files be in the test's folder; return that."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return tmp_path


def test_a_user_s_folder_is_made_and_found_again(place: Path) -> None:
    found = temporary_folder("roads")
    assert found == place / f"hdvplan-{os.geteuid()}" / "roads"
    assert found.is_dir()
    assert temporary_folder("roads") == found


def test_a_full_disk_takes_nothing(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = shutil.disk_usage(place)._replace(free=1_000_000)
    monkeypatch.setattr("shutil.disk_usage", lambda _: usage)
    assert temporary_folder("roads") is None


@pytest.mark.parametrize("level", [".", "hdvplan-{}", "hdvplan-{}/roads"])
def test_a_folder_into_which_all_may_write_is_not_taken(place: Path, level: str) -> None:
    assert temporary_folder("roads") is not None
    (place / level.format(os.geteuid())).chmod(0o777)
    assert temporary_folder("roads") is None


@root_only
@pytest.mark.parametrize("level", [".", "hdvplan-{}", "hdvplan-{}/roads"])
def test_a_folder_into_which_a_foreign_group_may_write_is_not_taken(place: Path, level: str) -> None:
    assert temporary_folder("roads") is not None
    shared = place / level.format(os.geteuid())
    shared.chmod(0o775)
    assert temporary_folder("roads") is not None  # the group of the user's own number
    os.chown(shared, -1, SOMEBODY)
    assert temporary_folder("roads") is None


def test_a_folder_in_a_sticky_one_is_safe_and_the_sticky_one_itself_is_not(place: Path) -> None:
    place.chmod(0o1777)
    found = temporary_folder("roads")
    assert found is not None
    found.chmod(0o1777)  # others may add files here
    assert temporary_folder("roads") is None


@root_only
@pytest.mark.parametrize("level", [".", "hdvplan-{}", "hdvplan-{}/roads"])
def test_another_user_s_folder_is_not_taken(place: Path, level: str) -> None:
    assert temporary_folder("roads") is not None
    os.chown(place / level.format(os.geteuid()), SOMEBODY, SOMEBODY)
    assert temporary_folder("roads") is None


@root_only
def test_another_user_s_link_to_a_folder_of_ours_is_not_followed(place: Path) -> None:
    (place / "ours").mkdir()
    link = place / f"hdvplan-{os.geteuid()}"
    link.symlink_to(place / "ours")
    assert temporary_folder("roads") == link / "roads"
    os.chown(link, SOMEBODY, SOMEBODY, follow_symlinks=False)
    assert temporary_folder("roads") is None
