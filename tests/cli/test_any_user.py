"""Another user, without a home, beside others, on full and read-only disks: it plans. Really switches user: only root can run it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

import hdvplan
from tests.cli.conftest import small_disk
from tests.nightly import nightly

pytestmark = pytest.mark.slow  # a plan with its pictures in a new process takes 4 s
STRANGER, OTHER, NOBODY = 54321, 54322, 65534  # the first two are in no list of users
COMMAND = (sys.executable, "-m", "hdvplan")
PLAN = ("plan", "uturn", "--vehicle", "bus", "--horizon", "30", "--quiet", "--out", "plan")
PACKAGE = Path(hdvplan.__file__).parent


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


def _open_to_others() -> bool:
    """Tell whether another user can start this interpreter and import the package."""
    probe = [sys.executable, "-c", "import hdvplan, numpy"]
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


def test_without_a_home_and_without_a_name_it_plans(scene: Scene) -> None:
    assert scene.plans() == ""


@pytest.mark.parametrize("home", ["/nonexistent", *map(nightly, ("/", "/root"))])
def test_with_a_home_that_is_not_its_own_it_plans(scene: Scene, home: str) -> None:
    assert scene.plans(NOBODY, HOME=home) == ""


def test_with_a_full_home_it_plans(scene: Scene) -> None:
    home = scene.own("home", STRANGER)
    with small_disk(home, f"size=1m,uid={STRANGER}"):
        assert scene.plans(HOME=home) == ""


def test_where_another_user_has_taken_its_temporary_folder_it_plans(scene: Scene) -> None:
    scene.own(f"temporary/hdvplan-{STRANGER}", OTHER, 0o777)
    assert scene.plans(MPLCONFIGDIR=scene.own("matplotlib", STRANGER)) == ""


def test_several_users_plan_at_once(scene: Scene) -> None:
    started = [scene.start(user, *PLAN, HOME="/") for user in (STRANGER, OTHER, NOBODY)]
    assert [(process.communicate()[1], process.returncode) for process in started] == [("", 0)] * 3
