"""What users bring: a solver, an objective or a follower: ``package.module:name``, ``file.py:name``, a package's offer, a Python object.

An offer is an entry point of an installed package in the group ``hdvplan.solvers``, ``hdvplan.objectives`` or
``hdvplan.followers``.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from hashlib import file_digest, sha256
from importlib import import_module, metadata
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from traceback import extract_tb
from types import ModuleType

from hdvplan.errors import HdvplanError, OptionError, SolverError
from hdvplan.texts import did_you_mean, some_of

_REFERENCE = re.compile(r"(?P<home>.+):(?P<name>[^\W\d]\w*)")
_MOST_SHOWN = 5  # names in a hint
_DIGITS = 16  # of a digest in hexadecimal
_OURS = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Kind:
    """What can be brought: its word for messages, the group of its entry points, and the error where it cannot be used."""

    word: str
    group: str
    error: type[HdvplanError]


SOLVER = Kind("solver", "hdvplan.solvers", SolverError)
OBJECTIVE = Kind("objective", "hdvplan.objectives", OptionError)
FOLLOWER = Kind("follower", "hdvplan.followers", OptionError)


def is_reference(name: str) -> bool:
    """Tell whether a name says where its object is: ``package.module:name`` or ``file.py:name``."""
    return _REFERENCE.fullmatch(name) is not None


def offers(kind: Kind) -> dict[str, metadata.EntryPoint]:
    """Return what installed packages offer, by name; nothing is loaded. Of two of one name the first package in the alphabet has it."""
    found = sorted(metadata.entry_points(group=kind.group), key=lambda point: (point.name, point.dist.name if point.dist else ""))
    return {point.name: point for point in reversed(found)}


def unknown(kind: Kind, name: str, known: Collection[str]) -> HdvplanError:
    """Return the refusal of a name that is none of the ``known`` ones, nor a reference or an offer."""
    listed = f"{kind.word}s: {', '.join(known)}, or your own: file.py:name"
    hint = f"name the {kind.word} in the file, too: {name}:NAME" if name.endswith(".py") else did_you_mean(name, known, listed)
    return kind.error(f"unknown {kind.word} {name!r}", hint=hint)


def load(kind: Kind, name: str) -> Callable[..., object] | None:
    """Return what a reference or an offer names; None where ``name`` is neither.

    Raises:
        HdvplanError: ``kind.error``: there is no such file, module or object, or loading it fails.

    """
    match = _REFERENCE.fullmatch(name)
    if match is None:
        point = offers(kind).get(name)
        return None if point is None else _called(kind, name, lambda: point.load())  # noqa: PLW0108 - a bound method would load later too
    home, own = match["home"], match["name"]
    if home.endswith(".py") and not Path(home).is_file():
        msg = f"{kind.word} {name!r} cannot be loaded: there is no file {home!r}"
        raise kind.error(msg, hint=f"a path counts from {Path.cwd()}")
    return _called(kind, name, lambda: getattr(_file(Path(home)) if home.endswith(".py") else import_module(home), own))


def _called(kind: Kind, name: str, get: Callable[[], object]) -> Callable[..., object]:
    """Return what ``get`` returns; any failure there is the author's, and is reported in one line."""
    home, hint = name.rpartition(":")[0], None
    try:
        found = get()
    except (Exception, SystemExit) as error:
        if isinstance(error, ModuleNotFoundError) and home.endswith(".py"):
            hint = "what a file imports must lie beside it, be installed, or be in a folder of PYTHONPATH"
        elif isinstance(error, ModuleNotFoundError) and error.name and home.startswith(error.name):
            hint = "install the package, or name its file: file.py:name"
        own = name.rpartition(":")[2]
        why = f"{error_text(error)}{raised_at(error)}"
        if isinstance(error, AttributeError) and isinstance(error.obj, ModuleType) and error.name == own:
            why, module = f"{home} has no {own}", error.obj.__name__
            there = [one for one, thing in vars(error.obj).items() if callable(thing) and getattr(thing, "__module__", None) == module]
            hint = did_you_mean(own, there, f"it has {some_of(there, _MOST_SHOWN) or 'no class or function'}")
        msg = f"{kind.word} {name!r} cannot be loaded: {why}"
        raise kind.error(msg, hint=hint) from error
    if not callable(found):
        msg = f"{kind.word} {name!r} cannot be called: it is of type {type(found).__name__}"
        raise kind.error(msg)
    return found


def error_text(error: BaseException) -> str:
    """Return an error of somebody else's code as a phrase: its kind, and what it says in its first line."""
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__


def raised_at(error: BaseException) -> str:
    """Return which line of somebody else's file raised an error, or what it came from, in brackets; "" where none did."""
    steps = [step for step in extract_tb((error.__cause__ or error).__traceback__) if _OURS not in Path(step.filename).parents]
    own = [step for step in steps if not {"site-packages", "importlib"} & {*Path(step.filename).parts} and step.filename[:1] != "<"]
    return f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""


def _file(path: Path) -> object:
    """Return a file as a module, executed once for each content."""
    name = f"hdvplan_file_{path.stem}_{(digest := digest_of(path))}"
    if name not in sys.modules:
        spec = spec_from_file_location(name, path)
        if spec is None or spec.loader is None:
            msg = f"{path} is no Python file"
            raise ImportError(msg)
        module = module_from_spec(spec)
        sys.modules[name] = module  # dataclasses and pickle look their module up
        try:
            with _neighbours(path.parent):
                spec.loader.exec_module(module)
                _check_neighbours(path, digest)
        except BaseException:
            del sys.modules[name]
            raise
    return sys.modules[name]


@dataclass(frozen=True)
class _Beside:
    """Finds the modules of a folder, as Python does those beside a script."""

    folder: str

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Return where a module of the folder is; None of others, and of parts of packages."""
        return PathFinder.find_spec(name, [self.folder], target) if path is None else None


@contextmanager
def _neighbours(folder: Path) -> Iterator[None]:
    """Let the block import what lies in a folder; what is found so may be imported later, too, but nothing else of the folder."""
    finder = _Beside(str(folder.resolve()))
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)


def _check_neighbours(path: Path, digest: str) -> None:
    """Refuse a file that was given another file's neighbour, of the same name as its own: a process has one module of a name."""
    folder = path.parent.resolve()
    for top in _imported(path, digest):
        own, files = PathFinder.find_spec(top, [str(folder)]), _own_files(top)
        if own is not None and own.origin and files and Path(own.origin).resolve() not in files:
            msg = f"it imports {top}, which is that of {files[0].parent}, not {folder}: give one of them another name"
            raise ImportError(msg)


def digest_of(path: Path) -> str:
    """Return a digest of a file's content.

    Raises:
        OSError: it cannot be read.

    """
    with path.open("rb") as file:
        return file_digest(file, "sha256").hexdigest()[:_DIGITS]


def digest_of_own(path: Path) -> str:
    """Return a digest of a source file and of all that it imports, but for what is installed.

    Raises:
        OSError: it cannot be read.

    """
    own = digest_of(path)
    with _neighbours(path.parent):
        others = [digest for top in sorted(_imported(path, own)) if (digest := _digest_of_package(top, path.parent.resolve()))]
    return _together([own, *others]) if others else own


@cache
def _digest_of_package(top: str, _folder: Path | None = None) -> str | None:
    """Return a digest of the sources of a module or package and of all that it imports, as they were when first asked for; None of others.

    A process loads them once, too. They may lie in the folder of the file that imports them.
    """
    tops, digests = [top], list[str]()
    for one in tops:
        found = {file: digest_of(file) for file in _own_files(one)}
        digests += found.values()
        tops += sorted({name for file, digest in found.items() for name in _imported(file, digest)} - {*tops})
    return _together(digests) if digests else None


def _together(digests: Iterable[str]) -> str:
    return sha256(" ".join(digests).encode()).hexdigest()[:_DIGITS]


@cache
def _imported(path: Path, _digest: str) -> frozenset[str]:
    """Return the packages that a source file of a digest names in imports; none of a file that is no Python."""
    with suppress(SyntaxError, ValueError, RecursionError, MemoryError):  # what Python cannot parse it refuses to load, too
        nodes = list(ast.walk(ast.parse(path.read_bytes())))
        names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
        names += [node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module and not node.level]
        return frozenset(name.partition(".")[0] for name in names)
    return frozenset()


def _own_files(top: str) -> list[Path]:
    """Return the source files of a module or package that is neither installed nor Python's nor ours."""
    if top in sys.stdlib_module_names or top == _OURS.name:
        return []
    try:
        spec = find_spec(top)
    except (ImportError, ValueError):  # such as of __main__
        return []
    if spec is None or (spec.submodule_search_locations is None and not (spec.origin or "").endswith(".py")):
        return []
    homes = [Path(home).resolve() for home in spec.submodule_search_locations or [spec.origin or ""]]
    if any({"site-packages", "dist-packages"} & {*home.parts} for home in homes):
        return []
    return homes if spec.submodule_search_locations is None else sorted(file for home in homes for file in home.rglob("*.py"))


def version_of(kind: Kind, name: str) -> str | None:
    """Return the version of what a reference or an offer names: its package's, or a file's digest; None where it has none."""
    match = _REFERENCE.fullmatch(name)
    if match is None:
        point = offers(kind).get(name)
        return point.dist.version if point is not None and point.dist is not None else None
    home = match["home"]
    if home.endswith(".py"):
        return digest_of_own(Path(home)) if Path(home).is_file() else None
    packages = metadata.packages_distributions().get(home.partition(".")[0], [])
    return metadata.version(packages[0]) if packages else _digest_of_package(home.partition(".")[0])


def name_of(thing: str | Callable[..., object]) -> str:
    """Return what a record calls a solver or an objective: its name, or where the object is defined."""
    if isinstance(thing, str):
        return thing
    if isinstance(thing, partial):
        given = [*map(repr, thing.args), *(f"{name}={value!r}" for name, value in thing.keywords.items())]
        return f"{name_of(thing.func)}({', '.join(given)})"
    named = thing if hasattr(thing, "__qualname__") else type(thing)
    return f"{named.__module__}:{named.__qualname__}"


def identity_of(thing: str | Callable[..., object]) -> tuple[str, ...]:
    """Return what tells one solver or objective from another: a name; of a file or an object its own name and its source's digest.

    Raises:
        OptionError: the object has no source, or is defined inside a function, so that its source does not tell what it does.

    """
    if isinstance(thing, str):
        match = _REFERENCE.fullmatch(thing)
        if match is None or not match["home"].endswith(".py"):
            own = None if match is None else _digest_of_package(match["home"].partition(".")[0])
            return (thing,) if own is None else (thing, own)
        try:
            return match["name"], digest_of_own(Path(match["home"]))
        except OSError as error:
            msg = f"{thing!r} cannot be read: {error.strerror or error}"
            raise OptionError(msg) from error
    own = thing.__qualname__
    if "<" in own:  # <locals>, <lambda>
        msg = f"a case cannot tell {name_of(thing)} from another one: it is defined inside a function"
        raise OptionError(msg, hint="define it at the top of a module, or take a functools.partial of what is")
    try:
        file = Path(inspect.getsourcefile(thing) or "")
        return own, digest_of_own(file) if file.is_file() else sha256(inspect.getsource(thing).encode()).hexdigest()[:_DIGITS]
    except (OSError, TypeError) as error:
        msg = f"a case cannot tell {name_of(thing)} from another one: its source cannot be read"
        raise OptionError(msg, hint="put it into a file") from error
