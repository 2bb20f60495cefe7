"""What holds for all compiled kernels: what they take, and what importing them leaves behind."""

import ast
import importlib
import pkgutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from numba.core.registry import CPUDispatcher

import hdvplan
from hdvplan.jit import cache_folders
from hdvplan.kernelcache import KernelFile

PACKAGE = Path(hdvplan.__file__).parent
MOST = 10  # parameters of a function
NEED_OTHERS = {"hdvplan.solvers.daqp": "daqp", "hdvplan.solvers.proxqp": "proxsuite"}  # what an extra installs


def functions() -> dict[str, ast.FunctionDef]:
    """Return every function of the package but the command line's, whose options are parameters, by its full name."""
    found: dict[str, ast.FunctionDef] = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        inside = file.relative_to(PACKAGE).with_suffix("").parts
        nodes = ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if inside[0] != "cli" else ()
        found |= {f"{'.'.join(inside)}.{node.name}:{node.lineno}": node for node in nodes if isinstance(node, ast.FunctionDef)}
    return found


def parameters(function: ast.FunctionDef) -> int:
    """Count what a caller writes."""
    names = [one.arg for one in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def test_no_function_takes_more_parameters_than_a_reader_can_hold() -> None:
    counted = {name: parameters(node) for name, node in functions().items()}
    assert len(counted) > 500
    assert {name: count for name, count in counted.items() if count > MOST} == {}


def kernels() -> dict[str, CPUDispatcher]:
    """Return every compiled kernel of the package."""
    found: dict[str, CPUDispatcher] = {}
    for info in pkgutil.walk_packages([str(PACKAGE)], "hdvplan."):
        if info.name.startswith(("hdvplan.cli", "hdvplan.__main__")):
            continue
        try:
            module = importlib.import_module(info.name)
        except ModuleNotFoundError as missing:
            if missing.name is None or missing.name != NEED_OTHERS.get(info.name):
                raise
            continue
        found |= {f"{value.__module__}.{name}": value for name, value in vars(module).items() if isinstance(value, CPUDispatcher)}
    return found


def test_kernels_release_the_interpreter_and_are_kept_on_disk() -> None:
    found = kernels()
    assert len(found) > 50
    for name, kernel in found.items():
        assert kernel.targetoptions["nogil"] is True, name
        assert kernel._cache.cache_path.startswith(str(cache_folders().write)), name  # type: ignore[attr-defined]


def test_importing_the_package_leaves_numbas_cache_to_others() -> None:
    code = (
        "import numba; before = numba.config.CACHE_DIR; import hdvplan.api, hdvplan.judging.envelope, hdvplan.solvers.riccati;"
        "assert numba.config.CACHE_DIR == before; print('as it was')"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603 - our own
    assert ended.stdout == "as it was\n"


def test_processes_that_compile_one_kernel_at_the_same_time_never_load_each_other_s_code(tmp_path: Path) -> None:
    kind: Any = KernelFile  # numba, whose class it extends, has no types

    def cache_file() -> Any:  # noqa: ANN401
        return kind(tmp_path, "kernel")

    one, other = cache_file(), cache_file()
    empty = other._load_index()

    def meanwhile(name: str, data: object) -> None:
        """Save the other process's code between this one's index and its code; the other has read the index before."""
        other._load_index = lambda: empty
        other.save("other records", "other code")
        kind._save_data(one, name, data)

    one._save_data = meanwhile
    one.save("records", "code")
    assert cache_file().load("other records") == "other code"
    assert cache_file().load("records") in ("code", None)  # an index entry may be lost: that compiles once more


def test_a_damaged_index_is_replaced_by_what_is_saved_next(tmp_path: Path) -> None:
    file: Any = KernelFile(tmp_path, "kernel")
    (tmp_path / "kernel.nbi").write_bytes(b"torn")
    assert file.load("records") is None
    file.save("records", "code")
    again: Any = KernelFile(tmp_path, "kernel")
    assert again.load("records") == "code"
