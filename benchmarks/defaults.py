"""What `excite design ROBOT` costs, and what it reaches, for arms with shapes: built in, and with the meshes of URDFs.

With `--against CHECKOUT`, the same with the code of another checkout, arm by arm.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

import record
from measure import HERE, measured

_ROBOTS = "cmeel.prefix/share/example-robot-data/robots"
BUILT_IN = ("irp6", "ur10e", "iiwa7", "panda")
MESHES = {
    "z1": ("z1_description/urdf/z1.urdf",),
    "ur10, meshes": ("ur_description/urdf/ur10_robot.urdf",),
    "talos' left arm": ("talos_data/robots/talos_left_arm.urdf",),
    "panda, meshes": ("panda_description/urdf/panda.urdf",),
    "tiago's arm": ("tiago_description/robots/tiago_no_hand.urdf", "--tip", "arm_7_link"),
}


def arms() -> dict[str, list[str]]:
    """Robot and options of ``excite design`` for each."""
    places = distribution("example-robot-data")
    files = {name: [str(places.locate_file(f"{_ROBOTS}/{path}")), *tip] for name, (path, *tip) in MESHES.items()}
    return {name: [name] for name in BUILT_IN} | files


def run(robot: list[str], seed: int, checkout: Path) -> dict[str, Any]:
    """One default design: what the command takes, and what it finds."""
    with tempfile.TemporaryDirectory() as folder:
        options = ["--figures", "none", "--quiet", "--seed", str(seed), "--out", folder]
        code = f"import sys; sys.path.insert(0, {str(checkout)!r}); from excite.cli.main import main; main()"
        took = measured([sys.executable, "-c", code, "design", *robot, *options])
        content = json.loads(Path(folder, "design.json").read_text(encoding="utf-8"))
        search = content["solver"]["search"]
        return {
            "value": content["minimised_value"],
            "feasible": content["feasible"],
            "starts": len(content["solver"]["starts"]),
            "more": search.get("left"),
            "cpu": took.cpu,
        }


def cells(runs: list[dict[str, Any]]) -> list[str]:
    """One arm's cells of one checkout."""
    values, cpu = [each["value"] for each in runs], [each["cpu"] for each in runs]
    kept = "" if all(each["feasible"] for each in runs) else "; limits NOT kept"
    spread = f" ({min(values):.4g}-{max(values):.4g})" if len(values) > 1 else ""
    return [f"{statistics.median(values):.4g}{spread}{kept}", f"{max(cpu):.1f}"]


LIMITATIONS = (
    "plain defaults without figures: condition number of what is written, in all base parameters, median and range of "
    "the seeds, and the largest processor time of the whole command with all processes",
    "wanted: no default takes more than 30 s; processor time grows with the load of the machine",
    "capsules around the meshes of example-robot-data; arms of one tree or hand each, no trees",
)


def main() -> None:
    """Arms one after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="Another checkout, run beside this one.")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    given = parser.parse_args()
    against, seeds = given.against, given.seeds
    checkouts = {"": HERE.parent} | ({} if against is None else {" before": against.resolve()})
    before, found = record.load(), dict[str, dict[str, list[dict[str, Any]]]]()
    for name, robot in arms().items():
        found[name] = {label: [run(robot, seed, place) for seed in seeds] for label, place in checkouts.items()}
        print(name, *(cell for runs in found[name].values() for cell in cells(runs)), flush=True)
    head = ["arm", *(f"{what}{label}" for label in checkouts for what in ("cond(W)", "CPU s"))]
    rows = [[name, *(cell for runs in each.values() for cell in cells(runs))] for name, each in found.items()]
    record.save("defaults", before, {"arms": found}, record.table(head, rows), LIMITATIONS)


if __name__ == "__main__":
    main()
