"""Options of a task that say what a built-in model object was made with, so that files of results can."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from excite.registry import BUILT_IN, place_of

if TYPE_CHECKING:  # modules that describe options must import quickly
    from regressors.models.columns import Drives, Terms
    from regressors.models.load import Sensor
    from regressors.models.windows import Window

_TERMS = {
    "offset": "offset",
    "load_share": "load_share",
    "root": "root_friction",
    "asymmetry": "asymmetric_friction",
    "stribeck": "stribeck",
}


def options_of_model(model: Any) -> dict[str, Any] | None:
    """Fields of a `ModelChoice` by name, with which the model's name alone builds the same model."""
    if place_of(model) not in BUILT_IN["model"].values():
        return None
    options: dict[str, Any] = {}
    for name, value in dict(model.options).items():
        said = _OPTIONS[name](value) if name in _OPTIONS else None
        if said is None:
            return None
        options |= said
    return options


def _of_terms(terms: Terms) -> Mapping[str, Any] | None:
    if terms.coulomb != terms.viscous:
        return None
    chosen = {option: _drives(getattr(terms, name)) for name, option in _TERMS.items()}
    return {
        "friction": _drives(terms.coulomb),
        "rotor": terms.rotor,
        "reflected_rotors": terms.reflected,
        "stribeck_speed": terms.stribeck_speed,
        **chosen,
    }


def _drives(chosen: Drives) -> bool | tuple[str, ...]:
    return chosen if isinstance(chosen, bool) else tuple(map(str, chosen))


def _of_window(window: Window) -> Mapping[str, Any] | None:
    return None if window.step is not None else {"window": window.kind, "window_length": window.length}


def _of_sensor(sensor: Sensor) -> Mapping[str, Any]:
    from scipy.spatial.transform import Rotation

    angles = Rotation.from_matrix(sensor.rotation).as_euler("xyz")
    return {
        "sensor": sensor.link,
        "sensor_xyz": tuple(float(x) for x in sensor.translation),
        "sensor_rpy": tuple(float(angle) for angle in angles),
        "equations": tuple(sensor.equations),
    }


_OPTIONS: dict[str, Any] = {
    "terms": _of_terms,
    "window": _of_window,
    "sensor": _of_sensor,
    "sign_width": lambda width: {} if width == 0.0 else None,
    "carried": lambda carried: {"carried": dict(carried)},
}
