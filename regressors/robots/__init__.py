"""Built-in robot descriptions, one YAML file each; `regressors.readers.library` reads them."""

from __future__ import annotations

from importlib import resources
from pathlib import Path


def built_in_names() -> tuple[str, ...]:
    """Names of the built-in robots, in alphabetical order."""
    files = (Path(file.name) for file in resources.files(__name__).iterdir())
    return tuple(sorted(file.stem for file in files if file.suffix == ".yaml"))
