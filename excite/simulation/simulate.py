"""Simulation of the measurements of a robot that plays a design: entry point of command line and scripts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from excite.design.designed_motion import DesignedMotion
from excite.registry import built_in
from excite.simulation.integration import Progress
from excite.simulation.payload import Payload
from excite.simulation.played_limits import check_played
from excite.simulation.reference import MotionSource
from excite.simulation.run import simulate_motion
from excite.simulation.settings import AUTO, SimulationSettings
from excite.simulation.simulation import Simulation
from regressors.arguments import checked
from regressors.friction.curves import FrictionCurves
from regressors.numerical import numerical_work


@checked
@numerical_work(
    "the simulation",
    "masses, torques or gains of very different sizes are the likely cause: "
    "check `bandwidth`, `rate`, friction and load",
)
def simulate(
    source: DesignedMotion | MotionSource | str | Path,
    settings: SimulationSettings | None = None,
    *,
    noise: float | tuple[float, ...] | None = None,
    friction: FrictionCurves | str | Path | None = None,
    load: Payload | str | Path | None = None,
    trajectory: str | Path | None = None,
    approach_and_return: bool = True,
    beyond_limits: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> Simulation:
    """Simulate the robot of a design while it plays the motion, and its sensors.

    Parameters
    ----------
    source : DesignedMotion, MotionSource or path
        A design; its folder; or a file of a friction plan.
    settings : SimulationSettings, optional
        Settings of control, integration and measurement.
    noise : float or tuple of float, optional
        Standard deviation of the torque noise, short for ``torque_noise`` of the settings [Nm].
    friction : FrictionCurves or path, optional
        Replaces the friction of the robot's description for the drives that it names.
    load : Payload or path, optional
        Load behind the force/torque sensor.
    trajectory : path, optional
        File to play, in the format of trajectory.csv, instead of the design's motion.
    approach_and_return : bool
        Play the approach from home and the return too, where there are any and the design is in a folder.
    beyond_limits : bool
        Play a motion that breaks limits of its robot, see `excite.simulation.played_limits.broken_limits`.
    progress : callable, optional
        Called with the number of samples done and the total.
    **options
        Fields of `SimulationSettings`, by name.

    Returns
    -------
    Simulation
        Accepted wherever a log is; ``log`` is the log of the joints' sensors.

    Raises
    ------
    InputError
        Unknown inertias, a motion of other joints, or invalid settings.
    BrokenLimitError
        The motion breaks a limit.
    LostMotionError
        The motion diverges.
    """
    if noise is not None:
        options["torque_noise"] = noise
    settings = replace(settings if settings is not None else SimulationSettings(), **options)
    resolved = motion_source(source, trajectory, approach_and_return=approach_and_return)
    if not beyond_limits:
        check_played(resolved)
    if resolved.planned and settings.sign_width is None and settings.breakaway is None:
        settings = replace(settings, breakaway=AUTO)
    curves: FrictionCurves | None = _read("friction", friction)
    payload: Payload | None = _read("load", load)
    simulation = simulate_motion(
        resolved.robot,
        resolved.task,
        resolved.motion,
        settings,
        friction=curves,
        load=payload,
        ramps=resolved.ramps,
        progress=progress,
    )
    return replace(simulation, source=resolved)


def motion_source(
    source: DesignedMotion | MotionSource | str | Path,
    trajectory: str | Path | None = None,
    *,
    approach_and_return: bool = True,
) -> MotionSource:
    """Motion that a simulation plays."""
    if isinstance(source, MotionSource):
        return source
    file = None if trajectory is None else Path(trajectory)
    read: MotionSource = built_in("reader", "motion")(source, file, approach_and_return=approach_and_return)
    return read


def _read(kind: str, given: Any) -> Any:
    return built_in("reader", kind)(Path(given)) if isinstance(given, str | Path) else given
