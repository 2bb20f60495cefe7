"""Units of length."""

METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "ft": 0.3048, "in": 0.0254}  # exactly: the international foot
