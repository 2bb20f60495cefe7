"""Another user, without a home, beside others, on full and read-only disks: it plans. Really switches user: only root can run it."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

import hdvplan
from tests.cli.conftest import small_disk

pytestmark = pytest.mark.slow  # most of them compile everything: half a minute each
STRANGER, OTHER, NOBODY = 54321, 54322, 65534  # the first two are in no list of users
COMMAND = (sys.executable, "-m", "hdvplan")
PLAN = ("plan", "uturn", "--vehicle", "bus", "--horizon", "30", "--quiet", "--out", "plan")
PACKAGE = Path(hdvplan.__file__).parent
KEPT = "warning: compiled code is kept in {temporary} only ({reason}); NUMBA_CACHE_DIR names a folder to keep it in\n"
LOST = "warning: compiled code is not kept ({reason}): every run compiles; NUMBA_CACHE_DIR names a folder to keep it in\n"


@dataclass(frozen=True)
class Scene:
    """A folder that everybody may enter, with places for temporary files and for each user's plans."""

    folder: Path
    set_apart: list[Path] = field(default_factory=list)

    def own(self, name: str, user: int, mode: int = 0o755) -> Path:
        """Return a new folder of ``user``."""
        made = self.folder / name
        made.mkdir()
        made.chmod(mode)
        os.chown(made, user, user)
        return made

    def start(self, user: int, *arguments: str, **variables: str | Path) -> subprocess.Popen[str]:
        """Start the command line as ``user`` with nothing in its environment but these variables."""
        here = self.own(f"work{len(self.set_apart)}", user)
        self.set_apart.append(here)
        environment: dict[str, str | Path] = {
            "PATH": os.defpath,
            "PYTHONPATH": str(PACKAGE.parent),
            "TMPDIR": self.folder / "temporary",
            **variables,
        }
        return subprocess.Popen(  # noqa: S603 - our own
            [*COMMAND, *arguments], cwd=here, env=environment, user=user, group=user, extra_groups=[],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def plans(self, user: int = STRANGER, **variables: str | Path) -> str:
        """Plan ``uturn`` as ``user``, with pictures; return what stderr says."""
        process = self.start(user, *PLAN, **variables)
        out, err = process.communicate()
        assert (process.returncode, out) == (0, ""), err
        assert (self.set_apart[-1] / "plan" / "plan.png").is_file()
        return err

    def kept_by(self, user: int) -> Path:
        """Return where the compiled code of ``user`` goes for want of a better place."""
        return self.folder / "temporary" / f"hdvplan-{user}"


def _open_to_others() -> bool:
    """Tell whether another user can start this interpreter and import the package."""
    probe = [sys.executable, "-c", "import hdvplan, numba"]
    try:
        ended = subprocess.run(  # noqa: S603 - our own
            probe, cwd="/", env={"PYTHONPATH": str(PACKAGE.parent)}, user=STRANGER, group=STRANGER, extra_groups=[],
            check=False, capture_output=True,
        )  # fmt: skip
    except PermissionError:  # the interpreter lies in a folder of root's
        return False
    return ended.returncode == 0


@pytest.fixture
def scene() -> Iterator[Scene]:
    if not hasattr(os, "geteuid") or os.geteuid() != 0:
        pytest.skip("only root can switch user")
    if not _open_to_others():
        pytest.skip("this interpreter, or the package, is closed to other users")
    with TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        made = Scene(Path(name))
        made.own("temporary", 0, 0o1777)
        yield made


def test_without_a_home_and_without_a_name_temporary_files_keep_the_code_for_the_next_run(scene: Scene) -> None:
    assert scene.plans() == KEPT.format(temporary=scene.kept_by(STRANGER), reason="there is no home folder")
    assert scene.plans() == ""  # nothing compiles any more


@pytest.mark.parametrize(
    ("home", "reason"),
    [
        ("/", "/.cache: Permission denied"),
        ("/nonexistent", "/nonexistent: Permission denied"),
        ("/root", "/root/.cache: Permission denied"),
    ],
)
def test_with_a_home_that_is_not_its_own_it_plans(scene: Scene, home: str, reason: str) -> None:
    assert scene.plans(NOBODY, HOME=home) == KEPT.format(temporary=scene.kept_by(NOBODY), reason=reason)


def test_with_a_home_that_is_read_only_it_plans(scene: Scene) -> None:
    home = scene.own("home", STRANGER, 0o555)
    err = scene.plans(HOME=home)
    assert err == KEPT.format(temporary=scene.kept_by(STRANGER), reason=f"{home}/.cache: Permission denied")


def test_with_a_cache_folder_of_somebody_else_it_plans_from_its_home(scene: Scene) -> None:
    home, cache = scene.own("home", STRANGER), scene.own("cache", OTHER)
    assert scene.plans(HOME=home, XDG_CACHE_HOME=cache, MPLCONFIGDIR=home) != ""
    assert scene.plans(HOME=home, NUMBA_CACHE_DIR=cache) == ""
    assert list(cache.iterdir()) == []


def test_with_a_full_home_it_plans(scene: Scene) -> None:
    home = scene.own("home", STRANGER)
    with small_disk(home, f"size=1m,uid={STRANGER}"):
        err = scene.plans(HOME=home)
    assert err == KEPT.format(temporary=scene.kept_by(STRANGER), reason=f"{home}/.cache/hdvplan is full")


def test_on_a_disk_that_fills_up_while_it_compiles_it_plans(scene: Scene) -> None:
    home = scene.own("home", STRANGER)
    with small_disk(home, f"size=200m,nr_inodes=40,uid={STRANGER}"):
        err = scene.plans(HOME=home, MPLCONFIGDIR=scene.own("matplotlib", STRANGER))
    assert err == f"warning: compiled code is not kept ({home}/.cache/hdvplan: No space left on device): the next run compiles again\n"


def test_where_nothing_can_be_kept_it_plans(scene: Scene) -> None:
    scene.own("temporary/" + scene.kept_by(STRANGER).name, OTHER, 0o777)  # somebody was there first
    assert scene.plans(MPLCONFIGDIR=scene.own("matplotlib", STRANGER)) == LOST.format(reason="there is no home folder")


def test_a_cache_that_somebody_else_has_filled_is_not_unpickled(scene: Scene) -> None:
    own = scene.own("cache", STRANGER)
    assert scene.plans(NUMBA_CACHE_DIR=own, HOME=own) == ""
    mark = scene.own("mark", STRANGER) / "ran"
    for file in own.rglob("*.nbi"):
        file.write_bytes(pickle.dumps(_Poison(str(mark))))
    process = scene.start(STRANGER, *PLAN, NUMBA_CACHE_DIR=own, HOME=own)
    process.communicate()
    assert mark.exists()  # so it would
    mark.unlink()
    for path in (own, *own.rglob("*")):
        os.chown(path, OTHER, OTHER)
    assert scene.plans(NUMBA_CACHE_DIR=own, HOME=scene.own("home", STRANGER)) == ""
    assert not mark.exists()


class _Poison:
    """A pickle that makes a file where it is read."""

    def __init__(self, mark: str) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[object, ...]:
        return open, (self.mark, "w")


def test_many_users_plan_from_one_cache_that_they_cannot_write(scene: Scene) -> None:
    cache = scene.own("cache", 0)
    warm = scene.start(0, "warm-up", "--vehicle", "bus", NUMBA_CACHE_DIR=cache, HOME=scene.own("home", 0))
    warm.communicate()
    assert warm.returncode == 0
    started = [scene.start(user, *PLAN, NUMBA_CACHE_DIR=cache, HOME="/") for user in (STRANGER, OTHER, NOBODY)]
    assert [(process.communicate()[1], process.returncode) for process in started] == [("", 0)] * 3
    assert not list(scene.folder.glob("temporary/hdvplan-*/*/*/*.nbc"))  # nobody has compiled


def test_several_processes_that_compile_at_once_all_plan(scene: Scene) -> None:
    home = scene.own("home", STRANGER)
    started = [scene.start(STRANGER, *PLAN, HOME=home) for _ in range(4)]
    assert [(process.communicate()[1], process.returncode) for process in started] == [("", 0)] * 4
    assert scene.plans(HOME=home) == ""
