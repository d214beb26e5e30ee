"""What controllers want to know of a payload, one file per controller."""

from __future__ import annotations

from importlib import import_module

from excite.payload.held_body import HeldBody
from regressors.errors import UnknownName

_PLACES = {
    "ur": "universal_robots",
    "franka": "franka_load",
    "kuka": "kuka_load_data",
    "abb": "abb_loaddata",
    "urdf": "urdf_link",
}
CONTROLLERS = tuple(_PLACES)
FILES = {
    "ur": "payload.script",
    "franka": "payload.franka.cpp",
    "kuka": "payload.dat",
    "abb": "payload.mod",
    "urdf": "payload.urdf",
}


def controller_text(name: str, body: HeldBody, frame: str) -> str:
    """The payload in a controller's own words."""
    if name not in _PLACES:
        raise UnknownName("controller", name, CONTROLLERS)
    module = import_module(f"excite.payload.controllers.{_PLACES[name]}")
    return str(module.payload_text(body, frame))


def frame_of(name: str) -> str:
    """In which frame a controller expects centre and inertia, in words."""
    module = import_module(f"excite.payload.controllers.{_PLACES[name]}")
    return str(module.EXPECTED)
