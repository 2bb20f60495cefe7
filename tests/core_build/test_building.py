"""The core is built by pip alone: with the machine's compiler, or with one that comes as a wheel."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(not (ROOT / "hatch_build.py").exists(), reason="needs the sources")


@pytest.fixture
def hook(tmp_path: Path) -> ModuleType:
    """Return the build script of a copy of the sources, which a test may change."""
    shutil.copy(ROOT / "hatch_build.py", tmp_path)
    shutil.copytree(ROOT / "hdvplan" / "core", tmp_path / "hdvplan" / "core")
    spec = importlib.util.spec_from_file_location("hatch_build", tmp_path / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def without_compiler(folder: Path) -> str:
    """Return a search path of programs that has no compiler."""
    (folder / "bin").mkdir()
    return str(folder / "bin")


def test_a_compiler_is_asked_for_only_where_there_is_none(hook: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ask = hook.CoreHook.dependencies
    monkeypatch.delenv("HDVPLAN_WHEEL", raising=False)
    monkeypatch.setenv("CC", "cc")
    assert ask(None) == []
    monkeypatch.delenv("CC")
    monkeypatch.setenv("PATH", without_compiler(tmp_path))
    assert ask(None) == [hook.ZIG]
    broken = tmp_path / "bin" / "cc"
    broken.write_text("#!/bin/sh\nexit 1\n", encoding="ascii")
    broken.chmod(0o755)
    assert ask(None) == [hook.ZIG], "a compiler that cannot compile, such as macOS has before its tools are installed"


def test_a_wheel_for_another_platform_is_compiled_by_zig(hook: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HDVPLAN_WHEEL", "win_amd64")
    assert hook.CoreHook.dependencies(None) == [hook.ZIG]
    monkeypatch.setenv("HDVPLAN_WHEEL", "win95")
    with pytest.raises(SystemExit, match=r"error: HDVPLAN_WHEEL is 'win95'.*; hint: take one of manylinux_2_17_x86_64"):
        hook.CoreHook.dependencies(None)


def test_a_core_that_does_not_compile_is_one_line(hook: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    for source in (tmp_path / "hdvplan" / "core").glob("*.c"):
        source.unlink()  # they take ten seconds
    (tmp_path / "hdvplan" / "core" / "wrong.c").write_text("int wrong(void) { return nothing; }\n", encoding="ascii")
    with pytest.raises(SystemExit) as ended:
        hook.build(tmp_path, ("baseline",), strict=False)
    said = str(ended.value)
    assert said.startswith("error: the C core could not be compiled by ")
    assert "wrong.c:1:" in said
    assert "; hint: install a C compiler, or pip install ziglang" in said
    assert "\n" not in said
    assert not list(tmp_path.glob("_core_*"))


def test_a_compiler_that_is_not_there_is_one_line(hook: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "imagined-cc")
    with pytest.raises(SystemExit, match=r"error: the C core could not be compiled by imagined-cc: .*imagined-cc.*; hint: "):
        hook.build(tmp_path, strict=False)


def test_the_digest_follows_the_sources(hook: ModuleType) -> None:
    before = hook.digest()
    (hook.SOURCES / "layout.c").write_text("", encoding="ascii")
    assert hook.digest() != before


@pytest.mark.slow
def test_a_wheel_serves_every_python_and_has_its_libraries(tmp_path: Path) -> None:
    built = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(tmp_path)]
    here = {key: value for key, value in os.environ.items() if key != "HDVPLAN_WHEEL"}
    subprocess.run(built, cwd=ROOT, env=here, check=True)  # noqa: S603 - our own build
    (wheel,) = tmp_path.glob("*.whl")
    assert wheel.name.split("-")[2:4] == ["py3", "none"]
    shutil.unpack_archive(wheel, tmp_path / "wheel", "zip")
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "wheel")}
    told = subprocess.run(
        [sys.executable, "-c", "from hdvplan import core; print(core._LIBRARY._name)"],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert Path(told.stdout).is_relative_to(tmp_path / "wheel")
