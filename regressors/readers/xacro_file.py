"""Reader of xacro files: URDF written with macros, expanded without ROS and without a network."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr
from pathlib import Path
from typing import Any

from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.readers.ros_packages import find_package
from regressors.readers.urdf import parse_urdf
from regressors.robot.robot import Robot


def read_xacro(
    path: str | Path,
    *,
    base: str | None = None,
    tip: str | None = None,
    arguments: Mapping[str, str] | None = None,
    packages: Iterable[str | Path] = (),
    snap_angles: bool = True,
) -> Robot:
    """Expand a xacro file, and read a serial chain of the URDF that comes out.

    Expressions in a xacro are evaluated by Python: expand files that you trust.

    Parameters
    ----------
    path : str or Path
    base, tip : str, optional
        Names of the first and the last link, see `regressors.readers.urdf.parse_urdf`.
    arguments : mapping of str to str, optional
        Values of the file's ``<xacro:arg>``, as ``name:=value`` on the command line of xacro.
    packages : iterable of str or Path, optional
        Folders to look for ``$(find package)`` in, see `regressors.readers.ros_packages.find_package`.
    snap_angles : bool
        Take rounded right angles for right angles, see `regressors.readers.urdf.parse_urdf`.

    Returns
    -------
    Robot
        Its ``source`` is ``"URDF <file name>"``.

    Raises
    ------
    UnknownName
        No link has the name given as base or tip.
    InputError
        xacro is not installed or does not expand the file, or the URDF holds no such serial chain; lines in the message
        are those of the expanded text.
    """
    path = Path(path)
    text = expand_xacro(path, arguments, packages)
    robot = parse_urdf(text, name_of_source=f"{path.name}, expanded", base=base, tip=tip, snap_angles=snap_angles)
    return robot.replace(source=f"URDF {path.name}")


def expand_xacro(
    path: str | Path, arguments: Mapping[str, str] | None = None, packages: Iterable[str | Path] = ()
) -> str:
    """Text of the URDF that a xacro file expands to; parameters as of `read_xacro`.

    Raises
    ------
    InputError
        xacro is not installed, or does not expand the file.
    """
    path = Path(path)
    _check_plain(path)
    xacro = _xacro(path)
    try:
        with _packages_found(xacro, path, tuple(packages)), redirect_stderr(io.StringIO()):
            document = xacro.process_file(str(path), mappings=dict(arguments or {}), verbosity=0)
    except InputError:
        raise
    except Exception as error:  # expressions of the file raise what they like
        if isinstance(getattr(error, "exc", None), InputError):
            raise error.exc from error  # type: ignore[attr-defined]
        if "Undefined substitution argument" in str(error):
            raise _missing_argument(path, str(error).split()[-1]) from error
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path.name}: xacro does not expand it: {reason}") from error
    return str(document.toprettyxml(indent="  "))


def _check_plain(path: Path) -> None:
    """Refuse a file whose entities would be expanded."""
    try:
        content = read_bytes(path)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {str(path)!r}: {getattr(error, 'strerror', None) or error}") from error
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise InputError(f"{path.name}: a DOCTYPE or ENTITY declaration is refused; remove the declaration")


def _missing_argument(path: Path, name: str) -> InputError:
    return InputError(
        f"{path.name}: the argument {name} has no value; expand the file with one, and give the URDF: "
        f"xacro {path.name} {name}:=VALUE > {path.name.split('.')[0]}.urdf"
    )


def _xacro(path: Path) -> Any:
    try:
        import xacro
        import xacro.substitution_args
    except ImportError as error:
        raise InputError(
            f"{path.name}: macros are expanded by xacro, which is not installed; "
            "pip install 'excite-trajectories[xacro]'"
        ) from error
    return xacro


@contextmanager
def _packages_found(xacro: Any, path: Path, roots: tuple[str | Path, ...]) -> Iterator[None]:
    """Let xacro find packages without an installation of ROS."""
    substitution = xacro.substitution_args

    def find(name: str) -> str:
        return str(find_package(name, path, roots))

    in_text, in_expressions = substitution._eval_find, substitution._eval_dict["find"]
    substitution._eval_find = substitution._eval_dict["find"] = find
    try:
        yield
    finally:
        substitution._eval_find, substitution._eval_dict["find"] = in_text, in_expressions
