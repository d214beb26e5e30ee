"""Files of what is known beforehand: friction curves, and values of parameters."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field

from excite.storage.atomic import Destination, write_bytes
from excite.storage.commit import settle
from regressors.arguments import checked
from regressors.errors import InputError, NumericalError
from regressors.quantities import fault as fault_of, shown
from regressors.readers.documents import (
    Celsius,
    Document,
    Exponent,
    FieldPath,
    Friction,
    described,
    parse_document,
    read_document,
    validate,
    yaml_float,
)
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, FunctionFriction, Stribeck, TableFriction
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm
from regressors.robot.friction.uncertainty import CurveUncertainty, curve_parameters

SCHEMA = "excite.friction/1"
_SIDES = ("forward", "backward")
_UNITS = (
    "# Torque [Nm or N] in the direction of a speed v [rad/s or m/s]: coulomb + viscous v, in a stribeck model also",
    "# + (stiction - coulomb) exp(-(v / stribeck)^exponent). Each K above temperature.reference [deg C] adds",
    "# temperature.coulomb + temperature.viscous v; range: lowest and highest temperature that was measured.",
    "# load: share of the torque that the drive carries, which friction takes on top.",
    "# uncertainty: covariance of parameters [products of their units], each named by its place here, such as",
    "# forward.coulomb; a name without a side, such as coulomb or temperature.viscous, is that of both sides alike.",
)
# fields of each model: required ones, optional ones
_FIELDS = {
    "coulomb-viscous": (("coulomb", "viscous"), ("offset",)),
    "stribeck": (("forward",), ("backward", "offset")),
    "table": (("speed", "torque"), ()),
}


@checked
def read_friction(path: str | Path) -> FrictionCurves:
    """Curves of a friction file.

    Parameters
    ----------
    path : path

    Raises
    ------
    InputError
        Cannot be read, is malformed (with the line), or has numbers that no friction can have.
    """
    path = Path(path)
    settle(Destination(path.parent))
    return _curves(read_document(path, "friction file"))


def friction_of(text: str, source: str) -> FrictionCurves:
    """Curves of a friction file's text."""
    return _curves(parse_document(text, source))


def friction_of_content(content: Mapping[str, Any]) -> FrictionCurves:
    """Curves that `friction_content` describes."""
    return _curves(Document("friction_curves", dict(content), {}))


def kept_curves(curves: FrictionCurves | Mapping[str, Any]) -> FrictionCurves:
    """Curves in the form that a file can hold: functions of the velocity become tables."""
    if isinstance(curves, FrictionCurves):
        return friction_of_content(friction_content(curves))
    if not isinstance(curves, Mapping):
        raise InputError(f"friction_curves: expected curves, as of `read_friction`, given {shown(curves)}")
    return friction_of_content(curves)


def _curves(document: Document) -> FrictionCurves:
    content = validate(document, FrictionFile)
    curves = {name: _curve(document, name, entry) for name, entry in content.drives.items()}
    uncertain = {name: entry.uncertainty for name, entry in content.drives.items() if entry.uncertainty is not None}
    return FrictionCurves(
        curves, {name: _uncertainty(document, name, curves[name], entry) for name, entry in uncertain.items()}
    )


def _uncertainty(document: Document, name: str, curve: FrictionCurve, entry: UncertaintyEntry) -> CurveUncertainty:
    place = ("drives", name, "uncertainty")
    known, count, rows = curve_parameters(curve), len(entry.parameters), entry.covariance
    available = ", ".join(known) or "none, a table has no parameters"
    wrong: list[tuple[FieldPath, str]] = [
        ((*place, "parameters", k), f"no parameter {x!r}; available: {available}")
        for k, x in enumerate(entry.parameters)
        if x not in known
    ]
    wrong += [
        ((*place, "covariance", k), f"needs {count} numbers, one per parameter, given {len(row)}")
        for k, row in enumerate(rows)
        if len(row) != count
    ]
    if len(rows) != count:
        wrong.append(((*place, "covariance"), f"needs {count} rows, one per parameter, given {len(rows)}"))
    if wrong:
        raise document.error(wrong)
    try:
        return CurveUncertainty(tuple(entry.parameters), np.array(rows))
    except InputError as error:
        raise document.error([(place, str(error).removeprefix("uncertainty: "))]) from error


def _curve(document: Document, name: str, entry: CurveEntry) -> FrictionCurve:
    place = ("drives", name)
    given = entry.model_dump(exclude_none=True, exclude={"model", "temperature", "load", "uncertainty"})
    needed, optional = _FIELDS[entry.model]
    fields = (*needed, *optional)
    wrong = [(field, f"is missing; model {entry.model} needs it") for field in needed if field not in given]
    beyond = f"does not belong to model {entry.model}; it has {', '.join(fields)}"
    wrong += [(field, beyond) for field in given if field not in fields]
    if wrong:
        raise document.error(((*place, field), what) for field, what in wrong)
    with document.at(*place):
        curve = _made(entry.model, given)
    if entry.temperature is not None:
        curve = _warm(document, (*place, "temperature"), curve, entry.temperature)
    if entry.load is None:
        return curve
    shares = (entry.load.forward, entry.load.backward) if isinstance(entry.load, LoadEntry) else (entry.load,)
    with document.at(*place, "load"):
        return Loaded(curve, *shares)


def _warm(document: Document, place: FieldPath, curve: FrictionCurve, entry: TemperatureEntry) -> Warm:
    both = {name: value for name in ("coulomb", "viscous") if (value := getattr(entry, name)) is not None}
    sides = {name: Slope(**side.model_dump()) for name in _SIDES if (side := getattr(entry, name))}
    if both and sides:
        raise document.error([((*place, next(iter(both))), "give it here, or in forward and backward, not in both")])
    if not both and "forward" not in sides:
        raise document.error([(place, "give coulomb or viscous here, or in forward (and backward)")])
    with document.at(*place):
        measured = None if entry.range is None else (entry.range[0], entry.range[1])
        return Warm(curve, entry.reference, **(sides or {"forward": Slope(**both)}), range=measured)


def _made(model: str, given: Mapping[str, Any]) -> FrictionCurve:
    if model == "coulomb-viscous":
        return CoulombViscous(**given)
    if model == "table":
        return TableFriction(given["speed"], given["torque"])
    sides = {name: Side(**given[name]) for name in _SIDES if name in given}
    return Stribeck(**sides, offset=given.get("offset", 0.0))


def write_friction(curves: FrictionCurves, path: Path) -> None:
    """Write curves to a file that reads back to the same numbers."""
    write_bytes(path, friction_text(curves).encode("utf-8"))


def friction_content(curves: FrictionCurves) -> dict[str, Any]:
    """Curves as plain values, the keys of a friction file; functions become tables."""
    content = parse_document(friction_text(curves), "friction curves").content
    assert isinstance(content, dict)
    return content


def friction_text(curves: FrictionCurves) -> str:
    """Text of a friction file that reads back to the same numbers."""
    lines = [f"schema: {SCHEMA}", *_UNITS, "drives:" if curves.curves else "drives: {}"]
    for name, curve in curves.curves.items():
        assert isinstance(curve, FrictionCurve)
        lines += [f"  {_quoted(name)}:", *(f"    {field}: {_flow(value)}" for field, value in _entry(curve).items())]
        if (known := curves.uncertainty.get(name)) is not None:
            rows = (f"        - {_flow(row)}" for row in known.covariance.tolist())
            lines += ["    uncertainty:", f"      parameters: {_flow(known.parameters)}", "      covariance:", *rows]
    return "\n".join(lines) + "\n"


def _entry(curve: FrictionCurve) -> dict[str, Any]:
    if isinstance(curve, Loaded):
        return _entry(curve.curve) | {"load": _sides(*curve.shares)}
    if isinstance(curve, Warm):
        slopes = _sides(asdict(curve.forward), asdict(curve.backward))
        measured = {} if curve.range is None else {"range": curve.range}
        return _entry(curve.curve) | {"temperature": {"reference": curve.reference, **slopes, **measured}}
    if isinstance(curve, FunctionFriction):
        curve = curve.table()
    if isinstance(curve, TableFriction):
        return {"model": "table", "speed": curve.speed.tolist(), "torque": curve.friction.tolist()}
    if isinstance(curve, (CoulombViscous, Stribeck)):
        return {"model": "stribeck" if isinstance(curve, Stribeck) else "coulomb-viscous", **asdict(curve)}
    raise InputError(f"a friction file holds no curve of type {type(curve).__name__}; available: {', '.join(_FIELDS)}")


def _sides(*sides: Any) -> Any:
    return sides[0] if sides[0] == sides[1] else dict(zip(_SIDES, sides, strict=True))


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return f"{{{', '.join(f'{field}: {_flow(each)}' for field, each in value.items())}}}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_flow, value))}]"
    if isinstance(value, str):
        return value
    if not np.isfinite(value):
        raise NumericalError("a friction curve has a parameter that is not finite, so that no file can hold it")
    return yaml_float(value)


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z_][\w-]*", name) else json.dumps(name, ensure_ascii=False)


class SideEntry(BaseModel, extra="forbid", allow_inf_nan=False):
    """Friction in one direction."""

    coulomb: Friction
    viscous: Friction = 0.0
    stiction: Friction | None = None
    stribeck: Friction = 0.05
    exponent: Exponent = 2.0


class SlopeEntry(BaseModel, extra="forbid", allow_inf_nan=False):
    """Temperature dependence of friction in one direction."""

    coulomb: Friction = 0.0
    viscous: Friction = 0.0


class TemperatureEntry(BaseModel, extra="forbid", allow_inf_nan=False):
    """Temperature dependence of friction."""

    reference: Celsius
    coulomb: Friction | None = None
    viscous: Friction | None = None
    forward: SlopeEntry | None = None
    backward: SlopeEntry | None = None
    range: Annotated[list[Celsius], Field(min_length=2, max_length=2)] | None = None


class LoadEntry(BaseModel, extra="forbid", allow_inf_nan=False):
    """Share of the carried torque in each direction."""

    forward: Friction
    backward: Friction


class UncertaintyEntry(BaseModel, extra="forbid", allow_inf_nan=False):
    """Covariance of a curve's parameters."""

    parameters: Annotated[list[str], Field(min_length=1)]
    covariance: list[list[Friction]]


class CurveEntry(BaseModel, extra="forbid", allow_inf_nan=False):
    """Curve of one drive."""

    model: Literal["coulomb-viscous", "stribeck", "table"]
    coulomb: Friction | None = None
    viscous: Friction | None = None
    offset: Friction | None = None
    forward: SideEntry | None = None
    backward: SideEntry | None = None
    speed: list[Friction] | None = None
    torque: list[Friction] | None = None
    temperature: TemperatureEntry | None = None
    load: Friction | LoadEntry | None = None
    uncertainty: UncertaintyEntry | None = None


class FrictionFile(BaseModel, extra="forbid", allow_inf_nan=False):
    """Complete friction file."""

    schema_: Literal["excite.friction/1"] = Field(alias="schema")
    drives: dict[str, CurveEntry]


_KEYS = ("value", "deviation")


def read_prior(path: Path) -> dict[str, dict[str, float]]:
    """Read values and standard deviations from a file such as ``X7: {value: 8.125, deviation: 0.5}``, in SI."""
    document = read_document(path, "prior file")
    assert isinstance(document.content, dict)
    problems = {name: fault(known) for name, known in document.content.items()}
    if any(problems.values()):
        raise document.error(((name,), what) for name, what in problems.items() if what)
    return {name: {key: float(known[key]) for key in _KEYS} for name, known in document.content.items()}


def known_beforehand(prior: object) -> object:
    """Check the entry ``prior`` of a task file: a relative uncertainty, or parameters as in a prior file."""
    if isinstance(prior, int | float) and not isinstance(prior, bool):
        if (wrong := fault_of("prior", prior)) is not None:
            raise ValueError(wrong)
        return prior
    if not isinstance(prior, dict):
        raise ValueError(f"expected a relative uncertainty or a mapping of parameters, given {described(prior)}")
    for name, known in prior.items():
        if what := fault(known):
            raise ValueError(f"{name}: {what}")
    return prior


def fault(known: object) -> str:
    """Problem with one parameter's entry as text; empty if it is valid."""
    if isinstance(known, dict) and set(known) == set(_KEYS) and all(isinstance(known[k], int | float) for k in _KEYS):
        wrong = ((key, fault_of(f"prior_{key}", known[key])) for key in _KEYS)
        return next((f"{key} {what}" for key, what in wrong if what is not None), "")
    given = f"a mapping of {', '.join(map(str, known))}" if isinstance(known, dict) else described(known)
    return f"expected finite numbers {{value: ..., deviation: ...}}, given {given}"
