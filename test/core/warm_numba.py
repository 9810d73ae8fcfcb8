"""Does what numba does once in a process, so that processes forked from this one need not."""
from __future__ import annotations

import numba
import qflsd_ros.core.compilation  # noqa: F401

numba.njit(lambda x: x + 1)(1)
