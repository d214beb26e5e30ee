"""Whether Python finds our `regressors` and `constraints`: other distributions and files have these names too."""

from __future__ import annotations

import os
from importlib import import_module
from importlib.util import find_spec

DISTRIBUTION = "excite-trajectories"
_HERE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def _explanation(package: str) -> str:
    """What is in the place of a package, and the remedy."""
    spec = find_spec(package)
    place = spec and (spec.origin or next(iter(spec.submodule_search_locations or ()), None))
    return (
        f"Python finds {place or 'nothing'} in place of the package `{package}` of `{DISTRIBUTION}` in {_HERE}: "
        "another file or distribution has this name, and may have replaced ours. Rename the file or uninstall the "
        "distribution; where files of ours are gone, run `python -m pip install --force-reinstall --no-deps "
        f"{DISTRIBUTION}` (or name the file or folder that you installed), best in an environment of its own."
    )


def check_packages() -> None:
    """Refuse to run with packages of others in place of ours."""
    for package in ("regressors", "constraints"):
        try:
            of = getattr(import_module(package), "DISTRIBUTION", None)
        except Exception as error:  # whatever another package of that name raises
            if getattr(error, "name", None) == DISTRIBUTION:
                raise
            raise ImportError(_explanation(package), name=DISTRIBUTION, path=_HERE) from error
        if of != DISTRIBUTION:
            raise ImportError(_explanation(package), name=DISTRIBUTION, path=_HERE)
