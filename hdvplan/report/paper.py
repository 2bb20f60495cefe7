"""What a drawing to scale may be asked for: paper and scale."""

from __future__ import annotations

from dataclasses import dataclass

from hdvplan.errors import OptionError

PAPERS_MM = {"a4": (297.0, 210.0), "a3": (420.0, 297.0), "a2": (594.0, 420.0), "a1": (841.0, 594.0), "a0": (1189.0, 841.0)}  # landscape
SCALES = (50, 100, 200, 250, 500, 1000, 2000)  # round ones, largest first: 1:50
_SMALLEST = 5000
_DIGITS = 100  # of a number that is worth reading


@dataclass(frozen=True)
class SheetOptions:
    """Paper, of ``PAPERS_MM``, and how many metres a metre of paper shows, or None for the largest round scale that fits.

    Raises:
        OptionError: no such paper, or a scale that no drawing has.

    """

    paper: str = "a3"
    scale: int | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn on."""
        if self.paper not in PAPERS_MM:
            msg = f"--sheet must be {', '.join(PAPERS_MM)}, not {self.paper!r}"
            raise OptionError(msg)
        if self.scale is not None and not 10 <= self.scale <= _SMALLEST:  # noqa: PLR2004 - 1:10 shows two metres on A4
            msg = f"--scale {self.scale} must lie between 10 and {_SMALLEST}: 200 draws 1:200"
            raise OptionError(msg)

    @classmethod
    def named(cls, paper: str, scale: str | None) -> SheetOptions:
        """Return the options by the words of the command line: ``A3`` and ``200`` or ``1:200``.

        Raises:
            OptionError: as above, or a scale that is no whole number.

        """
        if scale is None:
            return cls(paper.lower())
        digits = scale.removeprefix("1:").strip()
        if not digits.isdecimal() or len(digits) > _DIGITS:
            msg = f"--scale {scale!r} is not a scale: give 200 or 1:200"
            raise OptionError(msg)
        return cls(paper.lower(), int(digits))
