"""The core is loaded, and refused with one error where it does not fit."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hdvplan import core
from hdvplan.road.path import CURVE
from hdvplan.vehicle.model import UNIT

PACKAGE = Path(core.__file__).parent
BASELINE = next(PACKAGE.glob("_core_baseline.*"))


def copied(folder: Path) -> Path:
    """Return a copy of the library for every processor, with its sources beside it."""
    shutil.copy(BASELINE, folder)
    shutil.copytree(PACKAGE / "core", folder / "core")
    return folder


def loaded(name: str) -> str:
    """Return which library a new process loads when HDVPLAN_CORE has a value, or its error."""
    code = (
        "from hdvplan.errors import HdvplanError\n"
        "try:\n    from hdvplan import core\n    print(core._LIBRARY._name)\n"
        "except HdvplanError as error:\n    print(error, '|', error.hint)\n"
    )
    environment = os.environ | {"HDVPLAN_CORE": name}
    ended = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)  # noqa: S603 - this Python
    return ended.stdout.strip()


def test_the_environment_names_the_library() -> None:
    assert loaded("baseline") == str(BASELINE)


def test_a_library_that_nobody_built_is_one_error_with_a_hint() -> None:
    said = loaded("imagined")
    assert said.startswith("the C core is missing: there is no ")
    assert "_core_imagined" in said
    assert "| build it again: `pip install -e .`" in said
    assert "\n" not in said


def test_changed_sources_ask_for_a_new_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HDVPLAN_CORE", "baseline")
    folder = copied(tmp_path)
    core.load(folder)
    with (folder / "core" / "layout.c").open("a", encoding="utf-8") as file:
        file.write("/* changed */\n")
    with pytest.raises(core.CoreError, match="was built from other sources"):
        core.load(folder)


def test_a_library_without_sources_beside_it_is_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HDVPLAN_CORE", "baseline")
    folder = copied(tmp_path)
    shutil.rmtree(folder / "core")
    assert core.load(folder).hdv_has_avx2() in {0, 1}


def test_a_torn_library_is_one_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HDVPLAN_CORE", "baseline")
    (tmp_path / BASELINE.name).write_bytes(b"torn")
    with pytest.raises(core.CoreError, match="cannot be loaded") as caught:
        core.load(tmp_path)
    assert caught.value.hint is not None


@pytest.mark.skipif(not Path("/proc/cpuinfo").exists(), reason="the system does not tell what the processor has")
def test_the_core_asks_the_processor_as_the_system_does() -> None:
    flags = Path("/proc/cpuinfo").read_text(encoding="ascii").split()
    assert core.function("hdv_has_avx2", returns=core.INT)() == ("avx2" in flags and "fma" in flags)


def test_a_function_that_the_core_lacks_is_named() -> None:
    with pytest.raises(core.CoreError, match="has no function hdv_imagined"):
        core.function("hdv_imagined")


def test_a_record_has_the_core_s_fields_of_their_kinds() -> None:
    assert UNIT.itemsize == 64
    kinds = [UNIT["wheelbase"], UNIT["steered_by"], CURVE["coefficients"]]
    assert kinds == [np.dtype(kind) for kind in (np.float64, np.int64, core.ADDRESS)]


def test_constants_are_the_cores() -> None:
    assert core.number("HDV_SIDES") == 16
    assert core.constant("HDV_CLEAR_M") == 0.25
    with pytest.raises(core.CoreError, match="has no constant HDV_IMAGINED"):
        core.constant("HDV_IMAGINED")


@pytest.mark.parametrize("name", ["hdv_imagined", "hdv_contacts"])  # the one is none, the other's nested records are not said
def test_a_record_that_would_not_stand_where_the_core_has_it_is_refused(name: str) -> None:
    with pytest.raises(core.CoreError, match=f"no record {name} of such fields"):
        core.record(name)


@pytest.mark.parametrize(
    "array", [np.zeros((3, 2)).T, np.zeros((2, 3), np.float32), np.zeros((3, 2))], ids=["strided", "of another kind", "of another shape"]
)
def test_an_array_that_the_core_would_misread_is_refused(array: np.ndarray) -> None:
    with pytest.raises(ValueError, match="not a contiguous array"):
        core.address(array, float, (2, 3))
    whole = np.zeros((2, 3))
    assert core.address(whole, float, (2, 3)) == whole.__array_interface__["data"][0]
