"""What ``--verbose`` says of a run beside its result: times and versions."""

from __future__ import annotations

import platform
import time
from importlib.metadata import version

from rich.console import Console

from excite.cli.verbosity import verbosity

_LIBRARIES = ("numpy", "scipy", "casadi")


def print_run_facts(out: Console) -> None:
    """Print how long this process has run, and in which versions."""
    named = ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)
    own = f"excite {version('excite-trajectories')}, Python {platform.python_version()}, {named}"
    elapsed = time.monotonic() - verbosity().began
    out.print(f"{own}; {elapsed:.1f} s, {time.process_time():.1f} s CPU of this process", soft_wrap=True)
