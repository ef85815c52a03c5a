"""Array types that all rooms share."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]  #: numbers, double precision
Ints = NDArray[np.signedinteger[Any]]
Bools = NDArray[np.bool_]
