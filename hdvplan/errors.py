"""Every error that hdvplan raises on purpose: one root, few leaves.

Callers catch ``HdvplanError``; the command line turns it into one ``error:`` line and, where the error knows what
the user can do next, one ``hint:`` line. The numbers in a message are attributes as well, so that programs need not
parse text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


class HdvplanError(Exception):
    """Anything that hdvplan refuses to do, with the reason and, if known, the next step."""

    def __init__(self, message: str, *, hint: str | None = None) -> None:
        super().__init__(message)
        self.hint = hint
        if hint is not None:
            self.add_note(f"hint: {hint}")  # below a traceback

    def __reduce__(self) -> tuple[Callable[..., object], tuple[object, ...], dict[str, object]]:
        """Pickle with all attributes: the usual way calls the class again with the message alone, and leaves need more than that."""
        return _remade, (type(self), *self.args), self.__dict__


class RoadError(HdvplanError):
    """A road file or geometry that cannot be used; ``s_m`` is the arclength where, if it has one."""

    def __init__(self, message: str, *, s_m: float | None = None, hint: str | None = None) -> None:
        super().__init__(message, hint=hint)
        self.s_m = s_m


class ProjectionError(RoadError):
    """A point has no unique foot on the reference path: it lies beyond the centre of curvature, or an end."""

    def __init__(self, message: str, *, s_m: float, offset_m: float) -> None:
        super().__init__(message, s_m=s_m)
        self.offset_m = offset_m


class EntryError(HdvplanError):
    """An entry of a file or a setting that cannot be used; ``field`` names it where it is known."""

    def __init__(self, message: str, *, field: str | None = None, hint: str | None = None) -> None:
        super().__init__(message, hint=hint)
        self.field = field


class VehicleError(EntryError):
    """A vehicle description that cannot be used."""


class OptionError(EntryError):
    """A setting outside its range, or two settings that contradict each other."""


@contextmanager
def refused_in(where: str) -> Iterator[None]:
    """Say of an entry that the block refuses where it belongs; ``where`` is empty where that goes without saying.

    Raises:
        EntryError: it is refused.

    """
    try:
        yield
    except EntryError as error:
        error.args = (f"{where}: {error}",) if where else error.args
        raise


class QpDataError(HdvplanError):
    """A quadratic program handed to a solver with wrong sizes, non-finite values or crossed bounds."""


class SolverError(HdvplanError):
    """A solver is missing or returned nothing usable; ``status`` is its own word for it, ``s_m`` the place of the step."""

    def __init__(self, message: str, *, status: str | None = None, s_m: float | None = None, hint: str | None = None) -> None:
        super().__init__(message, hint=hint)
        self.status = status
        self.s_m = s_m


class PlanError(HdvplanError):
    """No plan exists from here: the vehicle leaves the domain of the road-aligned model at ``s_m``."""

    def __init__(self, message: str, *, s_m: float, hint: str | None = None) -> None:
        super().__init__(message, hint=hint)
        self.s_m = s_m


class TurnError(HdvplanError):
    """A prescribed manoeuvre that the vehicle cannot drive; ``least_radius_m`` is the least radius that it can, if one was found."""

    def __init__(
        self, message: str, *, radius_m: float | None = None, least_radius_m: float | None = None, hint: str | None = None
    ) -> None:
        super().__init__(message, hint=hint)
        self.radius_m = radius_m
        self.least_radius_m = least_radius_m


class MeasurementError(HdvplanError):
    """Two programs could not be measured against each other: one of them cannot be installed, started or run to its end."""


def _remade(kind: type[HdvplanError], *args: object) -> HdvplanError:
    """Return an error whose attributes are still to be set."""
    return kind.__new__(kind, *args)
