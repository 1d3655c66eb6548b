"""Types of arrays and vectors, and positions of the components in a contact wrench."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
Vector = tuple[float, float, float]

# Positions of the components in a contact wrench (f_t, f_o, f_n, m_t, m_o, m_n).
T, O, N, M_N = 0, 1, 2, 5
