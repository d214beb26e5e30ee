"""Robots by name or by file: built-in descriptions, robot YAML and URDF."""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import Path

from regressors.errors import InputError, UnknownName
from regressors.robot.robot import Robot

_DESCRIPTIONS = "regressors.robots"
_YAML = (".yaml", ".yml")
_URDF = (".urdf", ".xml", ".xacro", ".mjcf", ".sdf")  # what of these is no URDF says so itself


def built_in_names() -> tuple[str, ...]:
    """Names of the built-in robots, in alphabetical order."""
    files = (Path(file.name) for file in resources.files(_DESCRIPTIONS).iterdir())
    return tuple(sorted(file.stem for file in files if file.suffix == ".yaml"))


def built_in(name: str) -> Robot:
    """Robot that comes with this package.

    Parameters
    ----------
    name : str
        One of `built_in_names`.

    Returns
    -------
    Robot

    Raises
    ------
    UnknownName
        There is no built-in robot of that name.
    """
    if name not in built_in_names():
        raise UnknownName("built-in robot", name, built_in_names())
    return _built_in(name)


def load_robot(spec: str, base: str | None = None, tip: str | None = None, *, snap_angles: bool = True) -> Robot:
    """Robot by the name of a built-in one, or by its file.

    A built-in name wins over a file of the same name; write ``./irp6`` for the file.

    Parameters
    ----------
    spec : str
        Built-in name, or path of a description: robot YAML (``.yaml``, ``.yml``) or a URDF (``.urdf``, ``.xml``).
    base, tip : str, optional
        First and last link of the chain, for a URDF only.
    snap_angles : bool
        Take rounded right angles of a URDF for right angles, see `regressors.readers.urdf.parse_urdf`.

    Returns
    -------
    Robot

    Raises
    ------
    InputError
        Neither a built-in robot nor a file that describes one.
    """
    spec = str(spec)
    suffix = Path(spec).suffix.lower()
    if suffix not in _URDF and (base is not None or tip is not None):
        raise InputError(f"`base` and `tip` choose a chain of a URDF file, but {spec!r} is not a URDF file")
    if spec in built_in_names():
        return built_in(spec)
    if not Path(spec).exists():
        names = ", ".join(built_in_names())
        raise InputError(f"no robot {spec!r}: built-in robots are {names}, and a file of that name does not exist")
    if suffix in _YAML:
        from regressors.readers.description import read_description

        return read_description(spec)
    if suffix in _URDF:
        from regressors.readers.urdf import read_urdf

        return read_urdf(spec, base=base, tip=tip, snap_angles=snap_angles)
    raise InputError(f"{spec!r}: a robot's file ends in {', '.join((*_YAML, *_URDF[:2]))}")


@cache
def _built_in(name: str) -> Robot:
    from regressors.readers.description import parse_description

    file = resources.files(_DESCRIPTIONS) / f"{name}.yaml"
    return parse_description(file.read_text(encoding="utf-8"), f"built-in robot {name}")
