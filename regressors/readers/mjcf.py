"""Reader of MJCF, the models of MuJoCo: what moves of a compiled model, as a `Robot`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from regressors.errors import InputError, TooLargeError, reading
from regressors.input_files import FILE, in_bytes, opened, read_bytes, regular_size
from regressors.quantities import Tips
from regressors.readers.mjcf_tree import (
    Tie,
    equalities,
    feet_of,
    joint_actuators,
    names_of,
    on_feet,
    reflected,
    tree_of_model,
)
from regressors.readers.moving_part import MovingPart, carried, resting_rotation, working_ends
from regressors.readers.urdf import robot_of_tree
from regressors.readers.urdf_tree import UrdfTree
from regressors.robot.closures import Closure, MimicJoint
from regressors.robot.inertia import Array, parameter_names
from regressors.robot.robot import BASE, Drive, Limits, Robot, Transmission
from regressors.work_prediction import check_memory

_LEFT_OUT = {"springs": ("jnt_stiffness", "jnt_stiffnesspoly"), "damping that is not linear": ("dof_dampingpoly",)}
_UNNAMED = "MuJoCo Model"  # what the compiler calls a model without a name


def read_mjcf(path: str | Path, *, base: str | None = None, tip: Tips = None, snap_angles: bool = True) -> Robot:
    """Read what moves between a base and one or several last bodies of an MJCF file, as a `Robot`.

    MuJoCo compiles the file, so defaults, includes, attached models and inertias of geoms are what MuJoCo makes of
    them; meshes and textures that the file names must be there. The hinges and slides from the base to the tips
    become the robot's joints, and the rest of the tree is treated as that of a URDF
    (`regressors.readers.urdf.parse_urdf`): what hangs on a moving body by other joints is merged into it, its
    joints at position zero; free and ball joints off the chain rest where the file puts them.

    - A link's frame has the axes of its body. Its origin is the anchor of its hinge (``pos`` of the joint), or the
      body's origin where the joint slides. Zero of a joint's coordinate is MuJoCo's, also with ``ref``.
    - Position limits are those of limited joints. The torque limit of a joint is the smaller one of
      ``actuatorfrcrange`` and of the ranges of force, or of the control of plain motors, of all actuators that act on
      it directly, times their gears; of an uneven range the smaller side. MJCF has no limits on velocity, acceleration
      and jerk.
    - Armature becomes the rotor inertia of a drive of ratio 1, ``damping`` its viscous and ``frictionloss`` its Coulomb
      friction; all three are given as soon as one joint of the chain has one of them.
    - Gravity is that of ``<option>``, in the axes of the base; zero where the file disables it.
    - A joint that an equality constraint couples to another one is a mimic joint, one that it holds is fixed.
    - Bodies that an equality ``connect`` or ``weld`` holds together close a loop; moving joints without an actuator are
      then passive, and home is where the file puts the joints. A free joint of a body, of which parts are held to the
      world, becomes three slides and three hinges.
    - Not read: contacts, tendons, fluids, ``gravcomp`` (a part of the controller), and how actuators are controlled.
    """
    path = Path(path)
    model, tree = tree_of_mjcf(path, snap_angles=snap_angles)
    joints = names_of(model, "joint")
    robot = robot_of_tree(tree, base, tip)
    feet = feet_of(model) if base is None and tip is None else ()
    if not {*feet} <= {link.name for link in robot.links}:
        robot = robot_of_tree(tree, base, (*(link.name for link in robot.tips), *feet))
    ends = (tree.root if base is None else base, tuple(link.name for link in robot.tips))
    driven = [name for name, acting in zip(joints, joint_actuators(model), strict=True) if acting]
    passive = tuple(name for name in robot.joint_names if name not in driven)
    ties = [tie for tie in equalities(model)[2] if _ties(tie, tree, [link.name for link in robot.links])]
    for tie in ties:
        if tie.places is None or len(passive) == robot.n:
            raise _loop_refused(tie, tree, robot, ends)
    if ties or (robot.closures and len(passive) < robot.n):
        start = [float(model.qpos0[model.jnt_qposadr[joints.index(name)]]) for name in robot.joint_names]
        closures = tuple(_closure(tie, tree, robot, ends[0]) for tie in ties)
        robot = robot.replace(
            closures=(*robot.closures, *closures), passive=passive, home=np.array(start) if any(start) else None
        )
    return robot.replace(
        structure=replace(robot.structure, zero=frozenset(_without_body(robot, names_of(model, "body")))),
        transmission=_transmission(model, robot, joints),
        gravity=_gravity(model, tree, base),
        source=f"MJCF {path.name}{_left_out(model, robot, joints)}",
    )


def tree_of_mjcf(path: Path, *, snap_angles: bool = True) -> tuple[Any, UrdfTree]:
    """The compiled model of an MJCF, and its tree of links as `read_mjcf` takes it."""
    model = compiled(path)
    given = model.names.split(b"\0")[0].decode()
    name = path.stem if given in ("", _UNNAMED) else given
    return model, tree_of_model(model, name, path.name, snap_angles=snap_angles)


def compiled(path: Path) -> Any:
    """MuJoCo's model of a file."""
    try:
        import mujoco
    except ImportError as error:
        raise InputError(
            f"{path.name}: an MJCF is compiled by MuJoCo, which is not installed; "
            "pip install 'excite-trajectories[mujoco]'"
        ) from error
    with reading(repr(str(path))):
        regular_size(path)  # a device or a pipe would be read for ever
    check_mjcf_size(path)
    try:
        return on_feet(mujoco.MjModel.from_xml_path(str(path)), path)
    except ValueError as error:
        raise InputError(f"{path.name}: MuJoCo does not compile it: {' '.join(str(error).split())}") from error


def _without_body(robot: Robot, bodies: list[str]) -> Iterator[str]:
    """Parameters of the links that stand between the joints of one body."""
    for number, link in zip(robot.link_numbers, robot.links, strict=True):
        if link.name not in bodies:
            yield from parameter_names(number)


def _loop_refused(tie: Tie, tree: UrdfTree, robot: Robot, ends: tuple[str, tuple[str, ...]]) -> InputError:
    """Error for a constraint that makes moving joints depend on each other, or on others, with what can be read."""
    links = [body.name for body in robot.links]
    names = [joint for joint in tie.joints if joint in robot.joint_names]
    what = f"joint {names[0]!r}" if names else " and ".join(f"body {body!r}" for body in tie.bodies[:2])

    def accepts(part: MovingPart) -> None:
        if _ties(tie, tree, [joint.child for joint in part.moving]):
            raise InputError("still a loop")

    candidates = [*((link, ends[1]) for link in links), *((ends[0], (link,)) for link in reversed(links))]
    working = working_ends(tree, candidates, ends, accepts)
    cure = f", or choose the part beside it with {working}" if working else ""
    wanted = "expected joints that move on their own; switch it off in the file (active='false')"
    if tie.places is not None:
        wanted = (
            "and no actuator says which joints are driven; add actuators (<motor joint='NAME'/>), switch it off in the "
            "file (active='false')"
        )
    return InputError(f"{tree.source}: {tie.label} on {what} closes a loop with what moves, {wanted}{cure}")


def _closure(tie: Tie, tree: UrdfTree, robot: Robot, base: str) -> Closure | MimicJoint:
    """What a constraint holds together, in the frames of the links that carry its bodies."""
    assert tie.places is not None
    links = [link.name for link in robot.links]
    stop = {tree.above[link].name for link in links}
    frames, names = [], []
    for body, place in zip(tie.bodies, tie.places, strict=True):
        carrier = tree.carrier(body, links)
        resting = carrier not in links
        poses = dict(carried(tree, carrier, stop))
        frames.append((np.linalg.inv(poses[base]) if resting else np.eye(4)) @ poses[body] @ place)
        names.append(BASE if resting else carrier)
    axes = (frames[0] @ np.linalg.inv(frames[1]))[:3, :3].tolist() if tie.weld else None
    return Closure.from_dict({"bodies": names, "points": [frame[:3, 3] for frame in frames], "axes": axes})


def _ties(tie: Tie, tree: UrdfTree, links: list[str]) -> bool:
    """Whether a constraint holds between parts that moving links move differently."""
    moving = {tree.above[link].name for link in links}
    moved = {tree.carrier(body, links) for body in tie.bodies}
    return len(moved) > 1 or any(joint in moving for joint in tie.joints)


def _left_out(model: Any, robot: Robot, joints: list[str]) -> str:
    """What acts on moving joints and is no part of a `Robot`, as the end of a sentence."""
    parts = []
    for what, fields in _LEFT_OUT.items():
        names = [name for name in robot.joint_names if any(_acts(model, f, joints.index(name)) for f in fields)]
        parts += [f"{what} of {', '.join(names)}"] if names else []
    return f", without the {' and the '.join(parts)}" if parts else ""


def _acts(model: Any, field: str, joint: int) -> bool:
    values = getattr(model, field, None)  # MuJoCo 3 has no polynomials
    place = joint if field.startswith("jnt") else int(model.jnt_dofadr[joint])
    return values is not None and bool(np.any(values[place]))


def _transmission(model: Any, robot: Robot, joints: list[str]) -> Transmission | None:
    """Drives of the joints, with the armature as inertia of their rotors."""
    actuators = joint_actuators(model)
    armature = []
    for joint in (joints.index(name) for name in robot.joint_names):
        own = float(model.dof_armature[model.jnt_dofadr[joint]])
        armature.append(own + reflected(model, "actuator_armature", actuators[joint]))
    if not any(armature):
        return robot.transmission
    drives = [Drive(name, coulomb=0.0, viscous=0.0) for name in robot.joint_names]
    if robot.transmission is not None:
        drives = list(robot.transmission.drives)
    rotors = (
        replace(drive, rotor_inertia=None if drive.name in robot.passive and not inertia else inertia)
        for drive, inertia in zip(drives, armature, strict=True)
    )
    return Transmission(np.eye(robot.n), tuple(rotors), Limits.none(robot.n))


def _gravity(model: Any, tree: UrdfTree, base: str | None) -> Array:
    """Gravity in the axes of the base, with the joints above it at rest."""
    import mujoco

    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY:
        return np.zeros(3)
    R = resting_rotation(tree, tree.root if base is None else base)
    return np.asarray(R.T @ np.array(model.opt.gravity))


ELEMENTS = 10_000  # of a model, with all that is replicated: the time of MuJoCo grows with their square
_TEXTURE, _CELL, _MESH = 2.0, 16.0, 30.0  # bytes for each byte, of each cell, for each byte of the file; measured
_TEXT = 4 * FILE  # bytes of all files of XML together
_CUBE = ("cube", "skybox")
_PNG = b"\x89PNG\r\n\x1a\n"
_GRIDS = ("composite", "flexcomp")  # whose count makes many elements of one
_FOLDERS = {"texture": "texturedir", "mesh": "meshdir", "skin": "meshdir", "hfield": "assetdir", "flexcomp": "meshdir"}
_FACES = ("fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")


@dataclass
class _Scan:
    """What was found in the files of a model."""

    main: Path
    elements: float = 0.0
    read: int = 0  # bytes
    models: dict[str, float] = field(default_factory=dict)  # elements of those that may be attached
    folders: dict[str, str] = field(default_factory=dict)
    assets: list[tuple[str, dict[str, str], Path]] = field(default_factory=list)
    within: list[Path] = field(default_factory=list)  # files that are being read


def check_mjcf_size(path: Path) -> None:
    """Refuse a model that is too large, or that names what is no file."""
    scan = _Scan(path)
    try:
        _scan_file(scan, path, 1.0)
        sizes = [_asset(scan, *asset) for asset in scan.assets]
    except OSError as error:
        raise InputError(f"cannot read {error.filename or str(path)!r}: {error.strerror}") from error
    if sizes:
        _, what = max(sizes)
        check_memory(path.name, sum(size for size, _ in sizes), what, "give a smaller one, or remove it from the file")


def _scan_file(scan: _Scan, path: Path, times: float) -> None:
    """Go through a file, each of whose elements stands for as many as are replicated of it."""
    if path in scan.within:
        raise InputError(f"{scan.main.name}: {path.name} includes itself")
    try:
        content = read_bytes(path)
    except OSError as error:
        error.filename = str(path)
        raise
    scan.read += len(content)
    if scan.read > _TEXT:
        raise TooLargeError(f"{scan.main.name}: it and what it includes have more than {in_bytes(_TEXT)} of text")
    scan.within.append(path)
    counts = [times]

    def start(tag: str, given: dict[str, str]) -> None:
        counts.append(counts[-1] * _count(tag, given))
        scan.elements += counts[-1] * (1.0 + (scan.models.get(given.get("model", ""), 0.0) if tag == "attach" else 0.0))
        if tag == "compiler":
            scan.folders.update({name: value for name, value in given.items() if name.endswith("dir")})
        elif tag in ("include", "model") and "file" in given:
            _further(scan, tag, given, path, counts[-1])
        elif tag in _FOLDERS:
            scan.assets.append((tag, given, path))
        if scan.elements > ELEMENTS:
            raise TooLargeError(
                f"{path.name}, line {parser.CurrentLineNumber}: with this <{tag}> the model has {scan.elements:.3g} "
                f"elements, more than the {ELEMENTS} that a robot may have; lower the count of what is replicated, or "
                "remove it from the file"
            )

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: counts.pop()
    with suppress(expat.ExpatError):  # said by MuJoCo
        parser.Parse(content, True)
    scan.within.pop()


def _further(scan: _Scan, tag: str, given: Mapping[str, str], source: Path, times: float) -> None:
    """A part of the model in another file, or another model that is attached to it."""
    places = (scan.main.parent / given["file"], source.parent / given["file"])
    path = next((place for place in places if place.exists()), None)
    before = scan.elements
    if path is not None:
        _scan_file(scan, path, times)
    if tag == "model":
        scan.models[given.get("name", Path(given["file"]).stem)] = scan.elements - before


def _count(tag: str, given: Mapping[str, str]) -> float:
    """How many an element stands for."""
    return math.prod(_numbers(given, "count")) if tag == "replicate" or tag in _GRIDS else 1.0


def _numbers(given: Mapping[str, str], name: str) -> list[float]:
    with suppress(ValueError):
        return [max(1.0, float(word)) for word in given.get(name, "").split()]
    return []


def _asset(scan: _Scan, tag: str, given: Mapping[str, str], source: Path) -> tuple[float, str]:
    """Memory that an asset takes [bytes], and what it is."""
    files = [given[name] for name in ("file", *_FACES) if name in given]
    if files:
        parts = [_of_file(tag, _place(scan, tag, each, source)) for each in files]
        return sum(size for size, _ in parts), max(parts)[1]
    if tag == "texture":
        return _texture(given)
    rows, columns = (_number(given, name) for name in ("nrow", "ncol"))
    return (_CELL * rows * columns, f"a height field of {rows:g} x {columns:g}") if tag == "hfield" else (0.0, "")


def _texture(given: Mapping[str, str]) -> tuple[float, str]:
    wide, high = _number(given, "width"), _number(given, "height")
    cube = given.get("type", "cube") in _CUBE
    size = _TEXTURE * max(3.0, _number(given, "nchannel")) * wide * (6.0 * wide if cube else high)
    return size, f"a texture of {wide:g} x {wide if cube else high:g}"


def _number(given: Mapping[str, str], name: str) -> float:
    return next(iter(_numbers(given, name)), 0.0)


def _place(scan: _Scan, tag: str, name: str, source: Path) -> Path:
    """Where MuJoCo looks for a file."""
    folder = scan.folders.get(_FOLDERS.get(tag, ""), scan.folders.get("assetdir", ""))
    places = [parent / folder / name for parent in (scan.main.parent, source.parent)]
    return next((place for place in places if place.exists()), places[0])


def _of_file(tag: str, path: Path) -> tuple[float, str]:
    """Memory that a file takes [bytes]; nothing where it is missing, as MuJoCo says."""
    try:
        size = regular_size(path)
        with opened(path) as stream:
            head = stream.read(24)
    except FileNotFoundError:
        return 0.0, ""
    except OSError as error:
        error.filename = str(path)
        raise
    if head.startswith(_PNG):
        wide, high = (int.from_bytes(head[k : k + 4], "big") for k in (16, 20))
        each = _CELL if tag == "hfield" else 4.0 * _TEXTURE
        return each * wide * high, f"{path.name}, an image of {wide} x {high}"
    if tag == "hfield":
        rows, columns = (int.from_bytes(head[k : k + 4], "little") for k in (0, 4))
        return _CELL * rows * columns, f"{path.name}, a height field of {rows} x {columns}"
    return _MESH * size, f"{path.name}, a mesh of {size} bytes"
