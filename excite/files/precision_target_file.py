"""Files of a precision target, as YAML: the entries of `excite.PrecisionTarget`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from regressors.errors import InputError
from regressors.input_files import read_text
from regressors.readers.documents import parse_document


def read_precision_target(path: Path) -> dict[str, Any]:
    """Read a file such as ``share: 0.05`` and ``parameters: {X5: 0.1}``.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        Cannot be read, or malformed (with the line).
    """
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"precision: expected a share such as 5%, or a file, and cannot read {path}: "
            f"{getattr(error, 'strerror', None) or error}"
        ) from error
    document = parse_document(text, str(path))
    assert isinstance(document.content, dict)
    return {str(name): value for name, value in document.content.items()}
