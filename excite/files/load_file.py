"""Load files: the ten parameters of a body behind the force/torque sensor, as YAML."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict, create_model

from excite.simulation.payload import Payload
from regressors.errors import InputError
from regressors.input_files import read_text
from regressors.models.load import LOAD_PARAMETERS
from regressors.readers.documents import parse_document, validate
from regressors.readers.sized_numbers import Load

_LOAD: type[BaseModel] = create_model(
    "Load",
    __config__=ConfigDict(extra="forbid", allow_inf_nan=False),
    **{name: (Load, ... if name == "m" else 0.0) for name in LOAD_PARAMETERS},  # type: ignore[call-overload]
)


def read_load(path: Path) -> Payload:
    """Read a load file with the keys m, mcx ... Izz; missing ones are zero."""
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read load file {path}: {getattr(error, 'strerror', None) or error}") from error
    values = validate(parse_document(text, str(path)), _LOAD).model_dump()
    try:
        return Payload([values[name] for name in LOAD_PARAMETERS])
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
