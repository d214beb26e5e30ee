"""Information in hand as plain values, in ``design.json``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from excite.tasks.earlier_information import EarlierInformation
from regressors.samples import Array


def earlier_content(earlier: EarlierInformation) -> dict[str, Any]:
    """Entry of ``after`` in ``design.json``: the file with its hash, and the information that was taken from it."""
    return {
        **vars(earlier),
        "A": _sparse(earlier.A),
        "logs": list(earlier.logs),
        "parameters": list(earlier.parameters),
        "factors": [_sparse(F) for F in earlier.factors],
        "equations": [list(each) for each in earlier.equations],
        "density": None if earlier.density is None else list(earlier.density),
        "values": None if earlier.values is None else [float(x) if np.isfinite(x) else None for x in earlier.values],
    }


def earlier_of_content(content: Mapping[str, Any]) -> EarlierInformation:
    """Earlier information as a design holds it."""
    density, values = content["density"], content["values"]
    return EarlierInformation(
        **{
            **content,
            "A": _dense(content["A"]),
            "logs": tuple(content["logs"]),
            "parameters": tuple(content["parameters"]),
            "factors": tuple(_dense(F) for F in content["factors"]),
            "equations": tuple((str(name), str(unit)) for name, unit in content["equations"]),
            "density": None if density is None else tuple(float(x) for x in density),
            "values": None if values is None else np.array([np.nan if x is None else float(x) for x in values]),
        }
    )


def _sparse(A: Array) -> dict[str, Any]:
    """A matrix as its shape, and the places and values of what is not zero."""
    rows, columns = np.nonzero(A)
    return {"shape": list(A.shape), "rows": rows.tolist(), "columns": columns.tolist(), "values": A[A != 0.0].tolist()}


def _dense(content: Mapping[str, Any]) -> Array:
    A = np.zeros(tuple(content["shape"]))
    A[content["rows"], content["columns"]] = content["values"]
    return A
