"""Packages that only some formats need: imported when they are, and named with their extra where they are missing."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from regressors.errors import InputError

_PACKAGES = {"ros": "rosbags", "hdf5": "h5py", "matlab": "h5py", "parquet": "pyarrow"}  # of each extra


def optional_package(module: str, extra: str, source: Path) -> Any:
    """A module of an optional package."""
    try:
        return import_module(module)
    except ImportError as error:
        raise InputError(f"{source} needs {_PACKAGES[extra]}: pip install 'excite-trajectories[{extra}]'") from error
