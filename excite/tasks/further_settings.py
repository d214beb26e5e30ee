"""Settings that functions take as arguments: each is stated here once, for the command line, defaults and reference."""

from __future__ import annotations

from dataclasses import dataclass

from excite.registry import MODELS
from excite.tasks.limit_choice import Side
from excite.tasks.option import essential, option
from regressors.arguments import checked
from regressors.quantities import check

CONTROLLERS = ("ur", "franka", "kuka", "abb", "urdf")


@dataclass(frozen=True)
class MotionSettings:
    """What `excite.simulate` plays beside its settings, and the true friction and load."""

    trajectory: str | None = essential(
        None, "file", "Play this file, laid out as trajectory.csv, instead of the design's motion.", metavar="FILE"
    )
    approach_and_return: bool = option(
        True, "flag", "Also play the approach from home, the return, and slow parts and stops, if the design has them."
    )
    beyond_limits: bool = option(False, "flag", "Play a motion that breaks a limit, which is refused otherwise.")
    friction: str | None = essential(None, "file", "Friction curves.", metavar="FILE", unset="the robot's file")
    load: str | tuple[float, ...] | None = essential(
        None,
        "payload",
        "Load at the sensor, in its frame: m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz; or a YAML file of them.",
        metavar="M,MCX,...|FILE",
    )
    servos: str | None = essential(
        None, "file", "Identified servos follow the motion, and no controller.", metavar="DIR"
    )


@dataclass(frozen=True)
class BoundSettings:
    """Settings of `excite.bound`."""

    criteria: tuple[str, ...] = essential(
        ("condition",),
        "several",
        "Criterion to bound; repeatable.",
        choices=("condition", "logdet", "sigma-min"),
        flag="criterion",
    )
    seed: int = essential(0, "integer", "Seed of the search for states.")
    what_ifs: bool = essential(True, "flag", "Find what changes of the problem would bring, too.")


@dataclass(frozen=True)
class FrictionPoses:
    """Where the runs of `excite.plan_friction` are, and the ramps of torque."""

    pose: tuple[float, ...] | None = essential(
        None, "numbers", "Middle of every run.", metavar="Q,...", word="found", unset="found"
    )
    balanced: bool = option(
        False, "flag", "State that gravity cancels about the pose, for robots without known inertias."
    )
    torque_ramp: tuple[float, ...] | None = option(
        None,
        "numbers",
        "Largest torque of the ramps in NAME.stiction.csv; one for all, or one each, 0 for none.",
        metavar="T,...",
        unset="1.5 times the friction in the robot's file, at most half of the torque limit",
    )
    seed: int = option(0, "integer", "Seed of the random poses that are tried.")


@dataclass(frozen=True)
class PayloadMotionSettings:
    """Settings of `excite.design_payload_motion`."""

    box: float | tuple[float, ...] | tuple[Side, ...] = essential(
        0.2,
        "sides",
        "Box of the tool point: its sides about the centre, or its bounds in the base frame.",
        metavar="S|SX,SY,SZ|L:U,L:U,L:U",
    )
    centre: tuple[float, ...] | None = essential(
        None,
        "numbers",
        "Centre of the box in the base frame.",
        metavar="X,Y,Z",
        quantity="tool_point",
        unset="the tool point in the pose",
    )
    pose: tuple[float, ...] | None = essential(
        None,
        "numbers",
        "Present pose, which the motion is about.",
        metavar="Q,...",
        unset="the robot's home, or mid-range",
    )
    swing: tuple[float, ...] | None = essential(
        None,
        "numbers",
        "Largest deviation from the pose; one for all, or one each.",
        metavar="R,...",
        quantity="pose",
        unset="wrist 1.5, others 0.35",
    )
    sensor: str = essential(
        "torque",
        "name",
        "What measures: the joints' torques, or a force/torque sensor that carries the load.",
        choices=("torque", "wrench"),
    )
    period: float = essential(5.0, "number", "Duration of the motion.")
    harmonics: int = essential(3, "integer", "Harmonics of its Fourier series.")
    starts: int = essential(1, "integer", "Random starts; the best one is taken.")


@dataclass(frozen=True)
class UnloadedRows:
    """Rows of logs without a load, see `excite.LogChoice`."""

    without_rows: str = option("auto", "text", "Rows of the logs without the load, in the same way.", metavar="A:B")


@dataclass(frozen=True)
class CalibrationSettings:
    """Settings of `excite.calibrate_gains`."""

    mass: float = essential(None, "number", "Mass of that load.", metavar="KG", quantity="known_mass", required=True)
    common: bool = essential(False, "flag", "One factor for all drives, or one for each.", flag="common/each")


@dataclass(frozen=True)
class LoadFrame:
    """The frame in which a load is stated."""

    frame: tuple[float, ...] | None = essential(
        None,
        "frame",
        "Flange or sensor in the frame of the last link [m, rad]; panda: 0,0,0.107.",
        metavar="X,Y,Z[,R,P,Y]",
        unset="that frame itself",
    )


@dataclass(frozen=True)
class PayloadSettings:
    """Settings of `excite.identify_payload`."""

    gain_deviation: float | None = essential(
        None,
        "number",
        "Relative standard deviation of the stated gains, the same in all drives.",
        metavar="X",
        unset="0.1, and 0.05 of each",
    )
    frame_name: str | None = essential(
        None, "text", "What the frame is, for the files, such as flange.", metavar="NAME"
    )
    controller: str = essential(
        "all", "name", "Whose form of the payload is printed.", choices=("all", "none", *CONTROLLERS)
    )
    rated: float | None = essential(None, "number", "Largest load of the robot.", metavar="KG", quantity="known_mass")


@dataclass(frozen=True)
class EnsembleSettings:
    """Settings of `excite.export_ensemble`."""

    samples: int | None = essential(
        None, "integer", "Write an ensemble: N possible robots that the data of a result allow."
    )
    seed: int = essential(0, "integer", "Seed of the ensemble.", unset="0")
    level: float = essential(0.99, "number", "Share of the posterior within the ranges.", metavar="SHARE", unset="0.99")
    prior: float = essential(
        0.3,
        "number",
        "Relative deviation of the description, for what the data do not determine.",
        metavar="R",
        unset="0.3",
    )


@dataclass(frozen=True)
class GainSettings:
    """Settings of `excite.identify` for gains of drives, from logs with a known load."""

    known_mass: float | None = option(None, "number", "Mass of that load.", metavar="M")
    gains: str = option("each", "name", "One gain for each drive, or one for all.", choices=("each", "common"))


@dataclass(frozen=True)
class RepeatSettings:
    """Settings of the repetitions of an identification."""

    each: bool = option(False, "flag", "Of several logs: the estimate of each alone too, beside their scatter.")
    repeat: int = essential(0, "integer", "Repeat the experiment N times in simulation.")
    seed: int = option(0, "integer", "Seed of the repetitions.")


@dataclass(frozen=True)
class StudySettings:
    """Settings of `excite.study_over_time`."""

    repeats: int = essential(0, "integer", "Measure each run N times, such as 30.")
    below: float = essential(0.05, "percent", "Deviation that parameters are to fall below.", metavar="%")
    points: int = essential(100, "integer", "Number of instants.", metavar="K")
    estimator: str = essential("weighted", "name", "How to estimate.", choices=("weighted", "least-squares"))


@dataclass(frozen=True)
class Extents:
    """How much of an experiment `excite.predict_accuracy` and `excite.verify` look at."""

    count: int = essential(400, "integer", "Samples of the noise.", metavar="K")
    horizon: float = essential(0.5, "number", "Time after which the simulated motion restarts.")


@dataclass(frozen=True)
class CampaignSettings:
    """Settings of `excite.plan_campaign`, and of `excite.next_motion`."""

    model: str = essential("energy", "name", "Model whose equations identify the parameters.", choices=MODELS)
    at_once: int | None = essential(None, "integer", "Largest number of drives that move at the same time.", unset="2")
    of: str = essential("measured", "name", "Values that a precision is a share of.", choices=("measured", "described"))


@checked
@dataclass(frozen=True)
class Tolerances:
    """Largest errors of a result that holds.

    Parameters
    ----------
    torque : float
        Largest relative error over all equations.
    motion : float
        Largest error of the simulated motion of a joint, relative to its travel within a horizon.

    Raises
    ------
    InputError
        A tolerance that is not a positive number.
    """

    torque: float = essential(
        0.10,
        "percent",
        "Largest error of the torques, over all joints.",
        metavar="%",
        flag="torque-tolerance",
        quantity="torque_tolerance",
    )
    motion: float = essential(
        0.25,
        "percent",
        "Largest error of a joint's simulated motion.",
        metavar="%",
        flag="motion-tolerance",
        quantity="motion_tolerance",
    )

    def __post_init__(self) -> None:
        for name in ("torque", "motion"):
            check(f"{name}_tolerance", 100 * getattr(self, name))
