"""Choice of the model to identify: equations, joints and parameters.

The command line's help is generated from the class, so slow imports are deferred to where they are used.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from typing import TYPE_CHECKING, Any

from excite.registry import WINDOWS, OwnPart, name_of, part
from excite.tasks.installation import Triple
from excite.tasks.model_options import FURTHER_TERMS, DriveChoice, check_choice, numbers_of, options_of_model
from excite.tasks.option import essential, option, strict
from excite.tasks.stored_files import UnopenedFile
from regressors.errors import InputError

if TYPE_CHECKING:  # modules that describe options must import quickly
    from regressors.models.load import Sensor
    from regressors.models.model import RegressorModel
    from regressors.models.windows import Window
    from regressors.robot.columns import Terms
    from regressors.robot.friction.curves import FrictionCurves
    from regressors.robot.robot import Robot

FURTHER_FRICTION = tuple(FURTHER_TERMS.values())
FRICTION = ("friction", *FURTHER_FRICTION)


@dataclass(frozen=True)
class ModelChoice:
    """A model by name with its options, or a model object; and the joints or drives that move.

    Parameters
    ----------
    model : str or RegressorModel
        A registered name, or a model object, whose own options then replace those here.
    joints : tuple of str, optional
        Names or numbers of the joints that move; the others are locked. All of them, or the set for which the robot's
        description names its parameters, if not given.
    drives : tuple of str, optional
        Instead of joints: names or numbers of the drives that move; the others hold their coordinate z.
    window : {"short", "long"}
        Time windows of the models energy and load-integral.
    window_length : float
        Length of the short windows [s].
    sensor : str, optional
        Link that carries the force/torque sensor of the load models, by name or number; the last one if not given.
    sensor_xyz, sensor_rpy : tuple of float
        Pose of the sensor's frame in that link's frame [m, rad].
    equations : tuple of str, optional
        Which equations are used: of the load models some of fx, fy, fz, nx, ny, nz, of the differential model the
        torques of some moving coordinates; all if not given.
    friction : bool or tuple of str
        Coulomb and viscous friction as parameters: of all drives, of none, or of the drives of these names or numbers;
        in each case without those that have a curve in `friction_curves`.
    rotor : bool
        Rotor inertias as parameters.
    offset, load_share, root_friction, asymmetric_friction, stribeck : bool or tuple of str
        Further friction parameters of drives, chosen likewise, see `regressors.robot.columns.Terms`. In order a
        constant [Nm], a share of the torque that the drive carries [Nm/Nm], one with the root of the speed
        [Nm (s/rad)^0.5], half the difference of viscous friction between the directions [Nm s/rad], and friction beyond
        Coulomb's near standstill [Nm].
    stribeck_speed : float
        Velocity at which the Stribeck friction has fallen to 1/e [rad/s or m/s].
    carried : mapping of str to float, optional
        Standard parameters of the bodies and rotors whose torque the drives carry, for load shares; those of the
        robot's description if not given.
    joint_rotors : bool
        A rotor inertia for every drive, also where the robot's description states none.
    reflected_rotors : bool
        Rotor inertias as parameters at the drive coordinate, ``Iar = n^2 Ia`` with the gear ratio n (the largest one of
        a ball screw), which have the size of links' inertias; else the motors' own, ``Ia``. Parameters that the robot's
        description names, such as the IRp-6's X1, contain the motors' own as they say.
    symmetric : bool
        One set of parameters for limbs that mirror each other, such as two arms; offsets stay each drive's own. See
        `regressors.models.mirrored_limbs`.
    friction_curves : FrictionCurves, optional
        Friction that is known beforehand, by drive [KD96] section 4. These drives then have no friction parameters, the
        others keep theirs; torque limits use the curves.

    Raises
    ------
    UnknownName
        No such model or window.
    InputError
        Options that exclude each other, or an invalid length.
    """

    joints: tuple[str, ...] | None = essential(
        None, "names", "Joints that move, by name or number; the others are locked.", metavar="1,3"
    )
    drives: tuple[str, ...] | None = option(
        None, "names", "Instead of joints: drives that move; the others are locked.", metavar="2"
    )
    model: str | RegressorModel = essential(
        "differential", "name", "Equations that identify the parameters.", part="model"
    )
    window: str = option("short", "name", "Time windows of energy and load-integral.", choices=WINDOWS)
    window_length: float = option(0.005, "number", "Length of the short windows.")
    sensor: str | None = option(
        None, "text", "Link with the force/torque sensor (load models).", metavar="LINK", unset="the last"
    )
    sensor_xyz: Triple = option((0.0, 0.0, 0.0), "triple", "Sensor's origin in that link's frame.")
    sensor_rpy: Triple = option((0.0, 0.0, 0.0), "triple", "Sensor's axes: roll, pitch, yaw.", metavar="R,P,Y")
    equations: tuple[str, ...] | None = option(
        None, "names", "Equations to use: components of the wrench, or torques of joints.", unset="all", metavar="fx,nz"
    )
    friction: DriveChoice = essential(
        True,
        "drives",
        "Coulomb and viscous friction as parameters; of the drives without a friction curve.",
        flag="friction/no-friction",
    )
    rotor: bool = option(True, "flag", "Rotor inertias as parameters, where the robot's file has them.")
    joint_rotors: bool = option(False, "flag", "A rotor inertia per joint, also where the robot's file has none.")
    reflected_rotors: bool = option(
        True,
        "flag",
        "Rotor inertias at the drive coordinate, Iar = n^2 Ia, or the motors' own, Ia.",
        flag="reflected-rotors/motor-side-rotors",
    )
    offset: DriveChoice = option(
        False, "drives", "A constant friction offset per drive without a curve as a parameter.", flag="offset/no-offset"
    )
    load_share: DriveChoice = option(
        False, "drives", "A share of the torque that a drive carries as friction [Nm/Nm]", late=True
    )
    root_friction: DriveChoice = option(
        False, "drives", "Friction that grows with the root of the speed [Nm (s/rad)^0.5]", late=True
    )
    asymmetric_friction: DriveChoice = option(
        False, "drives", "Half the difference of viscous friction between directions [Nm s/rad]", late=True
    )
    stribeck: DriveChoice = option(
        False, "drives", "Friction beyond Coulomb's near standstill, F exp(-(v/V)^2) [Nm]", late=True
    )
    stribeck_speed: float = option(
        0.1, "number", "Speed at which that friction has fallen to 1/e.", metavar="V", late=True
    )
    carried: Mapping[str, float] | None = option(
        None,
        "parameters",
        "Standard parameters whose torque the drives carry, for load shares; the robot's own if not given.",
        hidden=True,
        late=True,
    )
    symmetric: bool = option(
        False, "flag", "One set of parameters for limbs that mirror each other, left and right.", late=True
    )
    friction_curves: FrictionCurves | UnopenedFile | None = option(
        None, "file", "Known friction curves; friction of the other drives is identified.", metavar="FILE"
    )

    def __post_init__(self) -> None:
        strict(self)
        if not isinstance(self.model, str | OwnPart | type):
            for name, value in (options_of_model(self.model) or {}).items():
                object.__setattr__(self, name, value)
        if self.joints is not None and self.drives is not None:
            raise InputError("`joints` and `drives` exclude each other; give one of them")
        if self.friction_curves is not None:
            if self.channel == "wrench":
                raise InputError("`friction_curves` is for models of joint torques; a wrench does not contain friction")
            if not isinstance(self.friction_curves, UnopenedFile):
                from excite.tasks.friction_file import kept_curves

                object.__setattr__(self, "friction_curves", kept_curves(self.friction_curves))

    @property
    def kind(self) -> Any:
        """The model, or the callable that builds it for a robot."""
        return part("model", self.model)

    @property
    def channel(self) -> str:
        """Channel of a log that the model explains: ``effort``, ``wrench`` or ``command``."""
        return "effort" if isinstance(self.model, OwnPart) else str(self.kind.channel)

    @property
    def keeps_all_links(self) -> bool:
        """True if no link may be merged with the one before, even where the joint between them is locked."""
        return not isinstance(self.model, OwnPart) and bool(self.kind.keeps_all_links)

    @property
    def bears_robot(self) -> bool:
        """True if the model explains the wrench below the base of the whole robot."""
        return not isinstance(self.model, OwnPart) and bool(self.kind.bears_robot)

    @property
    def known_friction(self) -> FrictionCurves | None:
        """Friction curves; raises `InputError` where a file of results names their file only."""
        if isinstance(self.friction_curves, UnopenedFile):
            raise self.friction_curves.missing()
        return self.friction_curves

    def terms_of(self, robot: Robot) -> Terms:
        """Optional columns beside the links' parameters, for the drives of a robot whose friction is not known.

        Parameters
        ----------
        robot : Robot
            With its moving joints only.
        """
        from regressors.robot.columns import Terms

        numbers = partial(numbers_of, robot=robot, curves=self.known_friction)
        friction = numbers(self.friction)
        return Terms(
            rotor=self.rotor,
            coulomb=friction,
            viscous=friction,
            reflected=self.reflected_rotors,
            stribeck_speed=self.stribeck_speed,
            **{term: numbers(getattr(self, option)) for term, option in FURTHER_TERMS.items()},
        )

    def check_drives(self, robot: Robot) -> None:
        """Raise `UnknownName` if a friction parameter is for a drive that the whole robot does not have.

        Parameters
        ----------
        robot : Robot
        """
        for name in FRICTION:
            check_choice(getattr(self, name), robot)

    @property
    def force_sensor(self) -> Sensor:
        """The force/torque sensor with the chosen equations; that of the model where an object has one."""
        import numpy as np

        from regressors.models.load import EQUATIONS, Sensor
        from regressors.robot.inertia import rotation_from_rpy

        own = getattr(self.model, "sensor", None)
        if isinstance(own, Sensor):
            return own
        rotation = rotation_from_rpy(self.sensor_rpy)
        return Sensor(self.sensor, rotation, np.array(self.sensor_xyz), self.equations or EQUATIONS)

    def built(self, robot: Robot) -> RegressorModel:
        """The model of a robot.

        A class is called with the robot and those of the options ``terms``, ``window``, ``sensor``, ``carried`` that it
        accepts.

        Parameters
        ----------
        robot : Robot

        Raises
        ------
        InputError
            `symmetric` of a robot without mirrored limbs, or of a model that is not of their bodies.
        """
        if not self.symmetric:
            return self._built(robot)
        from regressors.models.mirrored_limbs import with_mirrored_limbs

        tied = with_mirrored_limbs(robot)
        model, first = self._built(tied), next(iter(tied.structure.mirrored))
        if first in model.names or first not in model.definition()[1]:
            raise InputError(
                f"`symmetric` ties bodies of two limbs, which the {name_of(self.model)} model does not; leave it out"
            )
        return model

    def _built(self, robot: Robot) -> RegressorModel:
        kind = self.kind
        if not isinstance(kind, type):
            whole: RegressorModel = kind
            return whole.on(robot)
        options: dict[str, Callable[[], Any]] = {
            "terms": lambda: self.terms_of(robot),
            "window": lambda: self.time_window,
            "sensor": lambda: self.force_sensor,
            "carried": lambda: self.carried,
        }
        taken = {name: value() for name, value in options.items() if name in signature(kind).parameters}
        model: RegressorModel = kind(robot, **taken)
        return model

    def with_window(self, window: Window) -> ModelChoice:
        """The choice with another short window.

        Parameters
        ----------
        window : Window
        """
        if isinstance(self.model, str | OwnPart):
            return replace(self, window_length=window.length)
        return replace(self, model=self.model.with_window(window))

    @property
    def time_window(self) -> Window:
        """Window of the models that have one."""
        from regressors.models.windows import Window

        return Window("long" if self.window == "long" else "short", self.window_length)
