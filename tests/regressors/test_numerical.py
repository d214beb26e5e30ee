"""Linear algebra beside numbers that fail."""

from __future__ import annotations

import subprocess
import sys

_THREADS = """
import threadpoolctl
from regressors.numerical import one_thread
with one_thread():
    import scipy.linalg
    found = [one["num_threads"] for one in threadpoolctl.threadpool_info() if one["user_api"] == "blas"]
print(len(found), max(found))
"""


def test_one_thread_holds_for_the_library_of_scipy_too_which_is_loaded_late() -> None:
    out = subprocess.run([sys.executable, "-c", _THREADS], capture_output=True, text=True, check=True).stdout
    libraries, threads = map(int, out.split())
    assert libraries > 1
    assert threads == 1
