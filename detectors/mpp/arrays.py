"""Names of the arrays that the modules of this room exchange; axis order (row, column), row 0 northernmost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Floats", "Heights", "Integers", "Labels", "Mask", "RandomState", "Rectangles", "Scores", "States"]

#: Any numbers.
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
#: Rectangles, shape (n, 5), or one, shape (5,): see `rectangles`.
Rectangles = NDArray[np.float64]
#: Of cells: centimetres above ground, `cells` state, label of a patch (0: none), thousandths of a nat, and any choice.
Heights = NDArray[np.int32]
States = NDArray[np.uint8]
Labels = NDArray[np.int32]
Scores = NDArray[np.int16]
Mask = NDArray[np.bool_]
#: State of a random stream, shape (4,): see `random_stream`.
RandomState = NDArray[np.uint64]
