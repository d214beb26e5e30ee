"""Common style of figures: colours that colour-blind readers can tell apart, and text of names.

Fonts, sizes and resolution are those of ``styles/screen.mplstyle``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_params_from_file
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis, YAxis
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from regressors.quoting import printable

STYLES = Path(__file__).parent / "styles"
SCREEN: dict[str, Any] = dict(rc_params_from_file(STYLES / "screen.mplstyle", use_default_template=False).items())
DPI = float(SCREEN["savefig.dpi"])  # dots per inch
TITLE, LABEL, NOTE = (float(SCREEN[f"{what}size"]) for what in ("figure.title", "axes.label", "xtick.label"))  # [pt]

# Palette of Okabe and Ito (2008), "Color universal design".
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"
FORBIDDEN = "#F7DCC6"  # vermillion, light enough to draw on
BAND = "#CFE6F3"  # blue, light enough to draw on
GREY, DARK = "#8C8C8C", "#333333"
TITLE_STYLE: dict[str, Any] = {"fontsize": TITLE, "fontweight": "bold", "color": DARK}

ROUND = (1, 2, 2.5, 5, 10)  # steps between numbers on an axis
_LOG_TICKS = (  # up to this many decades: numbers in each
    (0.5, tuple(0.5 * k for k in range(2, 20))),
    (1.6, (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0)),
    (3.0, (1.0, 2.0, 5.0)),
    (float("inf"), (1.0,)),
)


def figure_of(width: float, height: float, title: str) -> Figure:
    """Create an empty figure with a title."""
    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    figure.suptitle(plain(title), **TITLE_STYLE)
    return figure


def tidy(ax: Axes) -> None:
    """Give a panel a light grid, small numbers, and lines only where they are read."""
    ax.grid(True, color=SCREEN["grid.color"], linewidth=SCREEN["grid.linewidth"])
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=NOTE, colors=DARK)
    ax.spines[["top", "right"]].set_visible(False)


def plain(text: str) -> str:
    """Literal text, where matplotlib would otherwise read formulas between dollar signs; once is enough."""
    lines = (printable(line) for line in text.split("\n"))
    return re.sub(r"(?<!\\)\$", r"\\$", "\n".join(lines))


def literal(figure: Figure) -> None:
    """Make every text of a figure literal: names of others may hold dollar signs and control characters.

    Numbers on axes are left out: matplotlib would make them, and make them anew when it draws.
    """
    for text in _texts(figure):
        if text.get_text() != (shown := plain(text.get_text())):
            text.set_text(shown)


def _texts(artist: Artist) -> Iterator[Text]:
    if isinstance(artist, Text):
        yield artist
    parts = (artist.label, artist.offsetText) if isinstance(artist, Axis) else artist.get_children()
    for part in parts:
        yield from _texts(part)


def typeset(text: str) -> str:
    """A unit or an expression with raised exponents and true minus signs, such as ``kg m²`` for ``kg m^2``."""
    raised = re.sub(r"\^([23])", lambda found: "²³"[int(found[1]) - 2], text)
    return plain(re.sub(r"(?<![\w.])-", "\N{MINUS SIGN}", raised))


def significant(value: float, digits: int) -> str:
    """A number with ``digits`` significant digits, including trailing zeros."""
    if value == 0.0 or not np.isfinite(value):
        return f"{value:g}"
    exponent = int(np.floor(np.log10(abs(value))))
    return f"{value:.{max(0, digits - 1 - exponent)}f}" if -4 <= exponent < 6 else f"{value:.{digits - 1}e}"


def log_scale(axis: XAxis | YAxis, lowest: float, highest: float) -> None:
    """Set a logarithmic scale with plain numbers, more per decade the fewer decades there are."""
    decades = float(np.log10(highest / lowest))
    set_scale, set_limits = (
        (axis.axes.set_xscale, axis.axes.set_xlim)
        if isinstance(axis, XAxis)
        else (axis.axes.set_yscale, axis.axes.set_ylim)
    )
    set_scale("log")
    set_limits(lowest, highest)
    axis.set_major_locator(LogLocator(subs=next(subs for most, subs in _LOG_TICKS if decades <= most)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())
