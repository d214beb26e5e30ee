"""One thread and one set of processor instructions (AVX2), so that processors of different age round alike."""

from __future__ import annotations

import os

KERNEL = "Haswell"
_WIDER = "X86_V4 AVX512_ICL AVX512_SPR"  # what NumPy would choose by itself on newer processors


def environment(kernel: str = KERNEL) -> dict[str, str]:
    """Variables of this process with those that decide how numbers are rounded.

    Parameters
    ----------
    kernel : str
        Of OpenBLAS, as its ``OPENBLAS_CORETYPE`` names it.
    """
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    instructions = {
        "OPENBLAS_CORETYPE": kernel,
        "NPY_DISABLE_CPU_FEATURES": _WIDER,
        "XLA_FLAGS": "--xla_cpu_max_isa=AVX2",
    }
    return {**os.environ, **threads, **instructions}
