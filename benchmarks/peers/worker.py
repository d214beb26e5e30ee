"""One run of one system in a process of its own: ``worker.py '{"system": ..., "case": ..., "seed": ..., "cpu": ...}'``.

Prints a motion as JSON in the last line. ``cpu`` is the processor time of the process, from its start [s].
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1]))  # after this folder, whose names come first

#: Module beside this file that has ``motion(specification)``.
MODULES = {"excite": "excite_search", "slsqp": "slsqp", "figaroh": "figaroh_search", "random": "random_motions"}


def main(wanted: Mapping[str, Any]) -> None:
    """Run the system."""
    print(json.dumps(import_module(MODULES[wanted["system"]]).motion(wanted)))


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
