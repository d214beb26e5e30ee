"""Names of figure files: one stem for each figure, one suffix for each format."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from excite.registry import FIGURE_FORMATS
from regressors.errors import InputError
from regressors.quantities import shown


def figure_names(stems: Iterable[str], formats: Iterable[str] = FIGURE_FORMATS) -> list[str]:
    """File of every figure in every format, such as ``motion.pdf``."""
    kinds = list(formats)
    return [f"{stem}.{kind}" for stem in stems for kind in kinds]


def check_formats(formats: str | Sequence[str]) -> tuple[str, ...]:
    """Formats as a tuple, each once; one name alone will do."""
    given = (formats,) if isinstance(formats, str) else tuple(formats)
    wrong = [each for each in given if each not in FIGURE_FORMATS]
    if wrong or not given:
        what = shown(wrong[0]) if wrong else "none"
        raise InputError(f"expected `formats` to be some of {', '.join(FIGURE_FORMATS)}; given {what}")
    return tuple(dict.fromkeys(given))
