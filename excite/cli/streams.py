"""Standard streams that cannot write every character, such as consoles of Windows: they write a question mark."""

from __future__ import annotations

import io
import sys


def write_what_is_known() -> None:
    """Let stdout and stderr replace characters that their encoding does not have."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and not (stream.encoding or "").lower().startswith("utf"):
            stream.reconfigure(errors="replace")
