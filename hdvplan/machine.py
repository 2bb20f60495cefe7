"""What a measurement depends on besides hdvplan's settings: machine, threads, versions, source. Imports nothing heavy."""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path

from hdvplan import plugins
from hdvplan.planning.settings import OBJECTIVE_NAMES
from hdvplan.version import __version__

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS")
_PACKAGES = ("numpy", "scipy", "pandas", "piqp", "clarabel", "osqp", "qpsolvers", "casadi")
_PACKAGE = Path(__file__).parent
_OTHERS = 0.5  # processes that wanted to run beside a measurement, as a share of the cores
BEHAVIOUR = _PACKAGE / "behaviour.toml"


def use_one_thread() -> bool:
    """Bind all numeric libraries to one thread; return whether it was early enough: they read this when they are loaded."""
    already = all(os.environ.get(name) == "1" for name in THREADS)
    early = "numpy" not in sys.modules
    os.environ.update(dict.fromkeys(THREADS, "1"))
    return early or already


def usable_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def machine_facts() -> dict[str, object]:
    """Return processor, cores, governor, operating system and Python; None where the system does not say."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "usable_cores": usable_cores(),
        "governor": _read(Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")),
        "system": platform.platform(),
        "python": f"{platform.python_implementation()} {platform.python_version()}",
    }


def machine_words(facts: Mapping[str, object]) -> str:
    """Return what a machine is, as far as times depend on it: processor and cores."""
    return f"{facts.get('processor')}, {facts.get('cores')} cores"


def load_average() -> list[float] | None:
    """Return the number of processes that wanted to run, over 1, 5 and 15 minutes; None where the system does not say."""
    return list(os.getloadavg()) if hasattr(os, "getloadavg") else None


def others_words(before: float | None, after: float | None, cores: int | None) -> list[str]:
    """Return what the load averages before a measurement and at its end say of others that ran beside it; nothing where few did."""
    if cores is None:
        return []
    found = [f"load {before:.1f} at the start"] if before is not None and before > _OTHERS * cores else []
    return found + ([f"load {after:.1f} at the end"] if after is not None and after - 1.0 > _OTHERS * cores else [])


def busy_warning(reasons: Sequence[str], cores: int | None) -> str:
    """Return the warning beside times that were measured on a busy machine; empty without ``reasons``."""
    on = "" if cores is None else f" on {cores} cores"
    return f"BUSY MACHINE: {', '.join(reasons)}{on}; measure again on a quiet one before you quote a time" if reasons else ""


@cache
def software(solvers: tuple[str, ...], objectives: tuple[str, ...] = ()) -> dict[str, object]:
    """Return hdvplan's version, a digest of its source, its behaviour, and the versions of the libraries that ``solvers`` use.

    What users brought, a solver or an objective, has its package's version, or its file's digest.
    """
    digest = hashlib.sha256()
    for source in sorted(file for file in _PACKAGE.rglob("*.*") if file.suffix in {".py", ".c", ".h"}):
        digest.update(source.relative_to(_PACKAGE).as_posix().encode())
        digest.update(source.read_bytes())
    return {
        "hdvplan": __version__,
        "source": digest.hexdigest()[:16],
        "behaviour": behaviour(),
        "packages": _versions(solvers, objectives),
    }


def behaviour() -> dict[str, int]:
    """Return the integer of every area of what hdvplan does; one is raised where results made before may be others now."""
    return {area: int(table["number"]) for area, table in tomllib.loads(BEHAVIOUR.read_text(encoding="utf-8")).items()}


@cache
def commit() -> str | None:
    """Return hdvplan's git commit, with ``+`` where its modules differ from it; None outside its own repository."""
    git = shutil.which("git")
    if git is None or _git(git, "ls-files", "--error-unmatch", "__init__.py") is None:
        return None
    head = _git(git, "rev-parse", "HEAD")
    return None if head is None else head + ("+" if _git(git, "status", "--porcelain", ".") else "")


def _git(git: str, *arguments: str) -> str | None:
    ended = subprocess.run([git, "-C", str(_PACKAGE), *arguments], capture_output=True, text=True, check=False)  # noqa: S603 - fixed arguments
    return ended.stdout.strip() if ended.returncode == 0 else None


def _versions(solvers: tuple[str, ...], objectives: tuple[str, ...]) -> dict[str, str]:
    from hdvplan.solvers.registry import DEFAULT, known_version  # noqa: PLC0415 - imports NumPy, which use_one_thread must precede

    versions = {name: known_version(name) for name in solvers if name not in {DEFAULT, *_PACKAGES}}
    versions |= {name: plugins.version_of(plugins.OBJECTIVE, name) for name in objectives if name not in OBJECTIVE_NAMES}
    for name in _PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    return {name: version for name, version in versions.items() if version is not None}


def _processor() -> str | None:
    lines = (_read(Path("/proc/cpuinfo")) or "").splitlines()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or None


def _read(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8").strip()
    except OSError:
        return None
