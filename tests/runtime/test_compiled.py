"""Where compiled loops are kept."""

import os
import subprocess
import sys
from pathlib import Path

from numba.core import caching

WORK = """
import os
import numpy as np
from bonecam.kernels.matrices import times
y = np.zeros((1, 3))
times(np.array([0, 1]), np.array([0]), np.array([2.0]), np.array([[1.0, 2.0, 3.0]]), y)
print(y[0, 2], os.environ["NUMBA_CACHE_DIR"])
"""


def test_loops_run_where_no_cache_can_be_written(tmp_path):
    (user,) = (name for name in dir(caching) if "UserProvided" in name)
    nowhere = {**os.environ, "NUMBA_CACHE_LOCATOR_CLASSES": user, "TMPDIR": str(tmp_path)}
    told = subprocess.run(
        [sys.executable, "-c", WORK], env=nowhere, capture_output=True, text=True, check=True, timeout=300
    )
    value, place = told.stdout.split()
    assert float(value) == 6.0
    assert Path(place).parent == tmp_path
    assert not list(tmp_path.iterdir()), "it lasts no longer than the process"
