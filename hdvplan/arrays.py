"""The types of arrays and records."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Records = NDArray[np.void]  # a structured array; every module that makes one names its columns
