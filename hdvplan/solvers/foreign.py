"""Solvers from outside hdvplan: every result or failure of their code becomes a result or an error of one line."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

from hdvplan.errors import HdvplanError, QpDataError, SolverError
from hdvplan.plugins import said
from hdvplan.qp.program import StageQp, StageSolution
from hdvplan.qp.workspace import QpResult, QpWorkspace


class ForeignWorkspace:
    """Another's workspace under the name by which users ask for it."""

    def __init__(self, name: str, make: Callable[[], QpWorkspace]) -> None:
        """Make it, and see that it has what ``QpWorkspace`` asks for.

        Raises:
            SolverError: it cannot be made, or lacks something.

        """
        self.name = name
        try:
            self._own = make()
            self.starts_warm = bool(self._own.starts_warm)
            if not callable(self._own.solve):
                _refuse(f"solver {name!r}: solve is no method")
        except HdvplanError:
            raise
        except AttributeError as error:
            _refuse(f"solver {name!r} is no QpWorkspace: {said(error)}", error)
        except Exception as error:  # noqa: BLE001 - an author's constructor may raise anything
            _refuse(f"solver {name!r} cannot be made: {said(error)}", error)

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``; see ``QpWorkspace``.

        Raises:
            SolverError: the solver raises, or what it returns is no result; ``status`` is ``raised``.

        """
        try:
            result: object = self._own.solve(qp, guess)
        except HdvplanError:
            raise
        except Exception as error:
            msg = f"solver {self.name!r} raises {said(error)}"
            raise SolverError(msg, status="raised") from error
        if not isinstance(result, QpResult):
            msg = f"solver {self.name!r} returns something of type {type(result).__name__}, not a QpResult"
            raise SolverError(msg, status="raised")
        try:
            result.point.address_for(qp.shape)
        except (AttributeError, QpDataError) as error:
            msg = f"solver {self.name!r} returns a point of another shape"
            raise SolverError(msg, status="raised") from error
        return result


def _refuse(message: str, error: Exception | None = None) -> NoReturn:
    raise SolverError(message, hint="docs/extending.md says what a solver's class must have") from error
