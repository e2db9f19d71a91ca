"""The array type that all modules share."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
