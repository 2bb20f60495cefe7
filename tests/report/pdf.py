"""Lines of a PDF page, in its own coordinates."""

from __future__ import annotations

import numpy as np
from pypdf import PageObject
from pypdf.generic import ContentStream

from hdvplan.arrays import FloatArray

MM = 25.4 / 72.0  # of a PDF's unit


def strokes(page: PageObject) -> list[FloatArray]:
    """Return all straight lines that are drawn or filled, as points on the paper (n, 2) [mm]."""
    lines, points, transforms = list[FloatArray](), list[list[float]](), [np.eye(3)]
    for operands, operator in ContentStream(page.get_contents(), page.pdf).operations:
        if operator == b"q":
            transforms.append(transforms[-1])
        elif operator == b"Q":
            transforms.pop()
        elif operator == b"cm":
            a, b, c, d, e, f = (float(value) for value in operands)
            transforms[-1] = np.array([[a, b, 0.0], [c, d, 0.0], [e, f, 1.0]]) @ transforms[-1]
        elif operator in {b"m", b"l"}:
            points = [*([] if operator == b"m" else points), [float(value) for value in operands]]
        elif operator in {b"S", b"f"} and points:
            lines.append(MM * (np.column_stack([np.array(points), np.ones(len(points))]) @ transforms[-1])[:, :2])
            points = []
    return lines
