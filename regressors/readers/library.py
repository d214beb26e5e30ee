"""Robots by name or by file: the built-in descriptions, our YAML, URDF, xacro, MJCF, and tables."""

from __future__ import annotations

from contextlib import suppress
from difflib import get_close_matches
from functools import cache
from importlib import import_module, resources
from pathlib import Path

from regressors.arguments import checked
from regressors.errors import LIKE, InputError, check_names, shortened
from regressors.quantities import Tips
from regressors.readers.urdf_elements import MJCF, URDF, XACRO, xml_kind
from regressors.robot.plausibility import check_sizes
from regressors.robot.robot import Robot
from regressors.robots import built_in_names as built_in_names

_DESCRIPTIONS = "regressors.robots"
_YAML = (".yaml", ".yml")
_TABLE = ".csv"
_XML = (".urdf", ".xml", ".xacro", ".mjcf")
_OTHER = (".sdf",)  # whose reader says what to do
_FILES = (*_YAML, _TABLE, *_XML, *_OTHER)
_READERS = {  # each imported when it is needed: those of XML take their libraries with them
    **dict.fromkeys(_YAML, ("description", "read_description")),
    _TABLE: ("dh_table", "read_dh_table"),
    URDF: ("urdf", "read_urdf"),
    XACRO: ("urdf", "read_xacro"),
    MJCF: ("mjcf", "read_mjcf"),
}


@cache
def built_in(name: str) -> Robot:
    """Robot that comes with this package."""
    from regressors.readers.description import parse_description

    check_names("built-in robot", [name], built_in_names())
    file = resources.files(_DESCRIPTIONS) / f"{name}.yaml"
    return parse_description(file.read_text(encoding="utf-8"), f"built-in robot {name}")


@checked
def load_robot(
    spec: str | Path, base: str | None = None, tip: Tips = None, *, snap_angles: bool = True, xacro: bool = False
) -> Robot:
    """Robot by the name of a built-in one, or by its file.

    A built-in name wins over a file of the same name; write ``./irp6`` for the file.

    Parameters
    ----------
    spec : str or path
        Built-in name, or path of a description: ours (``.yaml``, ``.yml``), a Denavit-Hartenberg table (``.csv``, see
        `regressors.readers.dh_table`), or a URDF, a xacro or an MJCF
        (``.urdf``, ``.xacro``, ``.mjcf``, ``.xml``; the content decides between URDF and MJCF).
    base : str, optional
        First link, for a URDF, a xacro or an MJCF only.
    tip : str or sequence of str, optional
        Last link of the chain, or last links of the branches of a tree, likewise; all limbs if not given.
    snap_angles : bool
        Take rounded right angles of a URDF or an MJCF for right angles, see `regressors.readers.urdf.parse_urdf`.
    xacro : bool
        Expand the file as xacro although its name does not end in ``.xacro``, see
        `regressors.readers.urdf.read_xacro`.

    Returns
    -------
    Robot

    Raises
    ------
    InputError
        Neither a built-in robot nor a file that describes one.
    """
    robot = _read(str(spec), base, tip, snap_angles=snap_angles, xacro=xacro)
    check_sizes(robot, str(spec))
    return robot


def _read(spec: str, base: str | None, tip: Tips, *, snap_angles: bool, xacro: bool) -> Robot:
    suffix = Path(spec).suffix.lower()
    if not has_tree(spec) and (base is not None or tip is not None):
        raise InputError(f"`base` and `tip` choose a part of a URDF, xacro or MJCF file, but {spec!r} is none of them")
    if xacro and not has_tree(spec):
        raise InputError(f"`xacro` expands a file that ends in {', '.join(_XML)}, but {spec!r} is none of them")
    if spec in built_in_names():
        return built_in(spec)
    if not Path(spec).exists():
        names = ", ".join(built_in_names())
        raise InputError(
            f"no robot {spec!r}: {_meant(spec)}built-in robots are {names}, and a file of that name does not exist"
        )
    if suffix not in _FILES:
        raise InputError(f"{spec!r}: a robot's file ends in {', '.join((*_YAML, *_XML, _TABLE))}")
    kind = suffix if suffix in (*_YAML, _TABLE) else XACRO if xacro else xml_kind(spec)
    module, reader = _READERS[kind]
    chain = {"base": base, "tip": tip, "snap_angles": snap_angles} if suffix in (*_XML, *_OTHER) else {}
    robot: Robot = getattr(import_module(f"regressors.readers.{module}"), reader)(spec, **chain)
    return robot


def _meant(spec: str) -> str:
    """The question whether a built-in robot, or a robot's file in the same folder, of a near name is meant."""
    near = get_close_matches(spec, built_in_names(), 1, LIKE)
    folder = Path(spec).parent
    with suppress(OSError, ValueError):
        files = [path.name for path in folder.iterdir() if path.suffix.lower() in _FILES]
        near += [str(folder / name) for name in get_close_matches(Path(spec).name, files, 1, LIKE)]
    return f"did you mean {' or '.join(map(shortened, near))}? " if near else ""


def has_tree(spec: str) -> bool:
    """Whether a file is, by its name, one that holds a tree of links: a part of it is chosen by base and tip."""
    return Path(spec).suffix.lower() in _XML
