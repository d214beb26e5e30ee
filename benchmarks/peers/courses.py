"""One run of one system, ``courses.py '{"system": ..., "case": ..., "seed": ..., "cpu": ...}'``, iterate by iterate.

Prints, as JSON in the last line, ``motions``: processor time since the process began [s], compilers included, and the
motion that a system had then; ours also has ``values``, those of its random starts.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1]))  # after this folder, whose names come first

#: Module beside this file, and its function of a specification that returns pairs of time and variables.
RIVALS = {
    "ipopt": ("exact_gradients", "ipopt"),
    "slsqp-exact": ("exact_gradients", "slsqp"),
    "slsqp": ("slsqp", "iterates"),
}


def main(wanted: Mapping[str, Any]) -> None:
    """Run the system."""
    if wanted["system"] == "excite":
        print(json.dumps(import_module("excite_search").course(wanted)))
        return
    module, function = RIVALS[wanted["system"]]
    kept = getattr(import_module(module), function)(wanted)
    motion_of = import_module("baseline_slsqp").motion_of
    print(json.dumps({"motions": [(cpu, motion_of(x)) for cpu, x in kept]}))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # where CasADi leaves what it compiles
        main(json.loads(sys.argv[1]))
        os.chdir("/")
