"""Reader of xacro files: URDF written with macros, expanded without ROS, in a process without rights."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from regressors import input_files
from regressors.errors import InputError
from regressors.readers.urdf import parse_urdf
from regressors.robot.robot import Robot

CPU, WALL = 20, 60.0  # seconds of computing, and of waiting, that an expansion may take
MEMORY = 10**9  # bytes that it may take
_PROCESS = "regressors.readers.xacro_expansion"


def read_xacro(
    path: str | Path,
    *,
    base: str | None = None,
    tip: str | None = None,
    arguments: Mapping[str, str] | None = None,
    snap_angles: bool = True,
) -> Robot:
    """Expand a xacro file, and read a serial chain of the URDF that comes out.

    A process of its own expands it, without a network and with caps on time and memory; expressions are limited to
    `regressors.readers.xacro_expressions`. It opens files of the folder of this one, of its package and of the packages
    that it names, and does not see the environment.
    """
    path = Path(path)
    text = expand_xacro(path, arguments)
    robot = parse_urdf(text, name_of_source=f"{path.name}, expanded", base=base, tip=tip, snap_angles=snap_angles)
    return robot.replace(source=f"URDF {path.name}")


def expand_xacro(path: str | Path, arguments: Mapping[str, str] | None = None) -> str:
    """Text of the URDF that a xacro file expands to; parameters as of `read_xacro`."""
    path = Path(path)
    order = {
        "path": str(path),
        "arguments": dict(arguments or {}),
        "seconds": CPU,
        "memory": MEMORY,
        "silence": input_files.SILENCE,
    }
    answer = _answer(json.dumps(order), path)
    if "text" not in answer:
        raise InputError(answer["error"])
    return answer["text"]


def _answer(order: str, path: Path) -> dict[str, str]:
    """What the process that expands a file says."""
    command = [sys.executable, "-P", "-m", _PROCESS]  # -P: no module of the folder that it is started in
    try:
        done = subprocess.run(command, input=order.encode(), capture_output=True, timeout=WALL, check=False)
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{path.name}: expanding it takes more than {WALL:g} s, the most that it may") from error
    except OSError as error:
        raise InputError(f"{path.name}: the process that expands it does not start: {error.strerror}") from error
    if done.returncode == -getattr(signal, "SIGXCPU", 0) or done.returncode == -getattr(signal, "SIGKILL", 0):
        raise InputError(f"{path.name}: expanding it takes more than {CPU} s of computing, the most that it may")
    try:
        answer: dict[str, str] = json.loads(done.stdout)
    except ValueError as error:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:] or ["no reason is given"]
        raise InputError(
            f"{path.name}: the process that expands it ended with status {done.returncode}: {said[0]}"
        ) from error
    return answer
