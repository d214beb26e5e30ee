"""Execution of ``excite simulate``: the log of a robot that plays a motion."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import excite
from excite.cli.main import NOT_HELD
from excite.cli.options import chosen_of
from excite.cli.progress import progress_of_samples
from excite.cli.streams import in_options, remark, say, tell
from excite.cli.summary import show
from excite.errors import LostMotionError
from excite.identification.servo_result import load_servos
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import motion_source
from excite.simulation.simulation_files import paths_of
from excite.storage.records import json_of
from excite.storage.result_folder import result_file
from excite.tasks.further_settings import MotionSettings
from excite.tasks.payload import Payload
from excite.views.view import view_of


def simulate_and_write(source: Path, out: Path, **given: Any) -> None:
    """Simulate a motion, write the logs, and end with the exit status."""
    played = chosen_of(given, MotionSettings)
    settings = SimulationSettings(**chosen_of(given, SimulationSettings))  # refused before files are read
    design = excite.load_design(source, given["parts"]) if given["parts"] else source
    trajectory, both = played.pop("trajectory", None), played.pop("approach_and_return")
    resolved = motion_source(design, trajectory, approach_and_return=both)
    load = played.pop("load", None)
    load = Payload(load) if isinstance(load, tuple) else load
    if "servos" in played:
        played["servos"] = load_servos(played["servos"])
    seen = load is not None or resolved.task.model.bears_robot
    if not seen and resolved.task.model.channel == "wrench":
        remark("excite: note: the design is for a load, but none is simulated; give one with --load")
    try:
        with result_file(out):
            paths_of(out, wrench=seen, replace=given["force"])
            tell("simulating the motion")
            with progress_of_samples() as progress:
                simulation = excite.simulate(resolved, settings, load=load, progress=progress, **played)
            tell("writing")
            files = simulation.save(out, replace=given["force"])
    except LostMotionError as error:
        say(f"excite: {in_options(str(error))}")
        sys.exit(NOT_HELD)
    record = simulation.record

    def content() -> dict[str, Any]:
        shown = {"robot": record.robot, "rate": settings.rate, "failures": list(record.failures)}
        return {"out": str(out), "files": [str(file) for file in files], **json_of(record), **shown}

    of_wrench = resolved.task.model.channel == "wrench"
    log = next((path for path in files if of_wrench and path.name.endswith(".wrench.csv")), files[0])
    steps = [f"excite identify ROBOT {log} --out DIR"] if record.holds else []
    show(view_of(record), files, content=content, next_steps=steps, all_in=files[1].name)
    sys.exit(0 if record.holds else NOT_HELD)
