"""What may be printed on a stream beside text: colours, and lines that move.

``NO_COLOR`` (https://no-color.org) turns colours and emphasis off, ``FORCE_COLOR`` on; without either they are on
terminals only. A terminal that knows no sequences (``TERM=dumb``) gets neither.
"""

from __future__ import annotations

import os
from typing import TextIO

_PLAIN = ("dumb", "unknown")


def can_move(stream: TextIO) -> bool:
    """Whether a line on the stream can be drawn again."""
    return stream.isatty() and os.environ.get("TERM", "").lower() not in _PLAIN


def has_colours(stream: TextIO) -> bool:
    """Whether text on the stream may have colours and emphasis."""
    if os.environ.get("NO_COLOR"):
        return False
    plain = os.environ.get("TERM", "").lower() in _PLAIN
    return not plain and (bool(os.environ.get("FORCE_COLOR")) or stream.isatty())
