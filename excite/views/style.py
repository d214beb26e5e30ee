"""Common style of figures: colours that colour-blind readers can tell apart, widths, and text of names.

Fonts, sizes and resolution are those of ``styles/screen.mplstyle``; one more file for each width of a paper's columns
states what differs there. Figures are drawn in the style of `drawing_style`: a figure for a column is as wide as that,
with fewer panels side by side, placed by matplotlib's constrained layout.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib import rc_params_from_file, style as matplotlib_style
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis, YAxis
from matplotlib.collections import Collection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from excite.registry import FIGURE_WIDTHS
from excite.views.view import raised
from regressors.errors import InputError, printable
from regressors.quantities import shown

STYLES = Path(__file__).parent / "styles"
SCREEN: dict[str, Any] = dict(rc_params_from_file(STYLES / "screen.mplstyle", use_default_template=False).items())
DPI = float(SCREEN["savefig.dpi"])  # dots per inch
TITLE, LABEL, NOTE = (float(SCREEN[f"{what}size"]) for what in ("figure.title", "axes.label", "xtick.label"))  # [pt]

# Palette of Okabe and Ito (2008), "Color universal design".
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"
COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
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


_LOG_WIDTH = 3.0  # of a horizontal axis with so many numbers [in]
_WIDTH: ContextVar[str] = ContextVar("width", default="screen")
_PAD = 0.08  # around panels on a screen [in]
_PLACED = 1.1  # width of a panel on a screen where it is placed, over that before
_LOW = 0.62  # height of a panel in a column, over that on a screen
LETTER, BOLD = 0.58, 0.7  # mean width of a letter over the size of the font


@contextmanager
def drawing_style(width: str) -> Iterator[None]:
    """Draw and write in the style of one of the widths; what the user's own matplotlibrc says does not count."""
    if width not in FIGURE_WIDTHS:
        raise InputError(f"expected `width` to be one of {', '.join(FIGURE_WIDTHS)}, given {shown(width)}")
    files = [STYLES / "screen.mplstyle", *([] if width == "screen" else [STYLES / f"{width}.mplstyle"])]
    before = _WIDTH.set(width)
    try:
        with matplotlib_style.context(files, after_reset=True):
            yield
    finally:
        _WIDTH.reset(before)


def column_width() -> float:
    """Width of the column that is drawn for [in]; infinite for a screen."""
    return float("inf") if _WIDTH.get() == "screen" else float(matplotlib.rcParams["figure.figsize"][0])


def columns_that_fit(most: int, width: float) -> int:
    """Number of columns of equal panels, `most` at the most, each with its numbers at least so wide [in]."""
    whole = column_width()
    return most if whole == float("inf") else min(most, max(1, int(whole / width)))


def size_of(parameter: str) -> float:
    """Size of the style that is drawn in, such as ``xtick.labelsize``."""
    style_in_use: Any = SCREEN if column_width() == float("inf") else matplotlib.rcParams
    return float(style_in_use[parameter])


def _in_proportion(parameter: str) -> float:
    """Size of the style that is drawn in, over that of figures for a screen."""
    return size_of(parameter) / float(SCREEN[parameter])


def figure_of(width: float, height: float, title: str, text: float = 0.0, notes: float = 0.0) -> Figure:
    """Create an empty figure with a title and room for notes; in a column of its width, and lower."""
    small, screen = _in_proportion("xtick.labelsize"), column_width() == float("inf")
    size = min(width, column_width()), low(height - text) + small * text + notes
    figure = Figure(figsize=size, facecolor="white")
    pads = {"w_pad": _PAD, "h_pad": _PAD} if screen else {}
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0, 1.0 - notes / size[1]), **pads)
    figure.suptitle(plain(broken(title, size[0], "figure.titlesize", BOLD)), **TITLE_STYLE)
    return figure


def broken(text: str, width: float, size: str = "xtick.labelsize", letter: float = LETTER) -> str:
    """Text in lines of a width [in], in a column; on a screen as it is."""
    if column_width() == float("inf"):
        return text
    letters = int(72.0 * width / (letter * size_of(size)))
    return "\n".join(textwrap.fill(line, letters, break_on_hyphens=False) for line in text.split("\n"))


def panel_width(ax: Axes) -> float:
    """Width of a panel, about: matplotlib has not placed it yet [in]."""
    return float(ax.bbox.width) / ax.figure.dpi * (_PLACED if column_width() == float("inf") else 1.0)


def low(height: float) -> float:
    """Height of a panel, or of a part of it, in the style that is drawn in [in]."""
    return height if column_width() == float("inf") else _LOW * height


def padded(low: float, high: float, share: float) -> tuple[float, float]:
    """A range with room above and below, a share of its height."""
    pad = share * (high - low) if high > low else max(0.1 * abs(high), 1e-12)
    return low - pad, high + pad


def plain(text: str) -> str:
    """Literal text, where matplotlib would otherwise read formulas between dollar signs; once is enough."""
    lines = (printable(line) for line in text.split("\n"))
    return re.sub(r"(?<!\\)\$", r"\\$", "\n".join(lines))


def literal(figure: Figure) -> None:
    """Make every text of a figure literal but numbers on axes, which matplotlib makes anew when it draws."""
    for text in _texts(figure):
        if text.get_text() != (shown := plain(text.get_text())):
            text.set_text(shown)


def _texts(artist: Artist) -> Iterator[Text]:
    if isinstance(artist, Text):
        yield artist
    parts = (artist.label, artist.offsetText) if isinstance(artist, Axis) else artist.get_children()
    for part in parts:
        yield from _texts(part)


def take_sizes(figure: Figure) -> None:
    """Give text and lines, which are drawn in the sizes for a screen, those of the style that is drawn in."""
    if column_width() == float("inf"):
        return
    small, thin = _in_proportion("xtick.labelsize"), _in_proportion("lines.linewidth")
    sizes = {TITLE: "figure.titlesize", LABEL: "axes.labelsize", NOTE: "xtick.labelsize"}
    taken = {size_of(parameter) for parameter in ("font.size", *sizes.values())}
    for text in _texts(figure):  # those of ticks follow below: to find them would make them
        before = float(text.get_fontsize())
        if before in sizes or before not in taken:
            text.set_fontsize(size_of(sizes[before]) if before in sizes else small * before)
        if isinstance(text, Annotation) and text.anncoords == "offset points":
            x, y = text.xyann
            text.xyann = small * float(x), small * float(y)
    for ax in figure.axes:
        ax.tick_params(labelsize=size_of("xtick.labelsize"))  # also where they were given one for a screen
        for artist in (*ax.lines, *ax.patches, *ax.collections):
            _thin(artist, thin)
    for legend in filter(None, [*figure.legends, *(ax.get_legend() for ax in figure.axes)]):
        for handle in legend.legend_handles:
            _thin(handle, thin)


def _thin(artist: Artist | None, share: float) -> None:
    if isinstance(artist, Line2D):
        artist.set(linewidth=share * float(artist.get_linewidth()), markersize=share * float(artist.get_markersize()))
    elif isinstance(artist, Patch):
        artist.set_linewidth(share * float(artist.get_linewidth()))
    elif isinstance(artist, Collection):
        artist.set_linewidth([share * float(width) for width in np.atleast_1d(artist.get_linewidth())])


def typeset(text: str) -> str:
    """A unit or an expression with raised exponents and true minus signs, such as ``kg m²`` for ``kg m^2``."""
    return plain(re.sub(r"(?<![\w.])-", "\N{MINUS SIGN}", raised(text)))


def significant(value: float, digits: int) -> str:
    """A number with ``digits`` significant digits, including trailing zeros."""
    if value == 0.0 or not np.isfinite(value):
        return f"{value:g}"
    exponent = int(np.floor(np.log10(abs(value))))
    return f"{value:.{max(0, digits - 1 - exponent)}f}" if -4 <= exponent < 6 else f"{value:.{digits - 1}e}"


def log_scale(axis: XAxis | YAxis, lowest: float, highest: float) -> None:
    """Set a logarithmic scale with plain numbers, more per decade the fewer decades there are."""
    decades = float(np.log10(highest / lowest))
    if isinstance(axis, XAxis) and column_width() < float("inf"):  # fewer numbers have room
        decades *= max(1.0, _LOG_WIDTH / (float(axis.axes.bbox.width) / axis.axes.figure.dpi))
    name = axis.axis_name
    axis.axes.set(**{f"{name}scale": "log", f"{name}lim": (lowest, highest)})
    axis.set_major_locator(LogLocator(subs=next(subs for most, subs in _LOG_TICKS if decades <= most)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())
