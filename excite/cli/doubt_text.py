"""Doubts about a result on the terminal: in words, before any number."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.text import Text

from excite.cli.literal_console import console
from excite.cli.messages import in_options


def print_doubts(content: Mapping[str, Any]) -> None:
    """Print why a result cannot be right, and what its logs do not determine."""
    out = console()
    for doubt in content["doubts"]:
        text = in_options(f"this result cannot be right: {doubt['what']}: {doubt['cause']}")
        out.print(Text(text, style="bold red"), soft_wrap=True)
    for warning in content["warnings"]:
        text = in_options(f"warning: {warning['what']}: {warning['cause']}; {warning['cure']}")
        out.print(Text(text, style="bold"), soft_wrap=True)


def next_steps(content: Mapping[str, Any], folder: Path) -> list[str]:
    """What to do next: the cures of the doubts, or else to verify."""
    cures = dict.fromkeys(in_options(doubt["cure"]) for doubt in content["doubts"])
    return [f"next: {cure}" for cure in cures] or [
        f"next: excite verify {folder} OTHER.csv, with a log that was not used here"
    ]
