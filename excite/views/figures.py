"""Figures of whatever has a view: as matplotlib objects, or as files beside it."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import IO, Any
from xml.etree import ElementTree

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_mixed import MixedModeRenderer
from matplotlib.backends.backend_svg import FigureCanvasSVG, RendererSVG
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from excite.storage.atomic import replacing
from excite.storage.manifest import read_manifest
from excite.storage.result_folder import amend_result, check_formats, figure_names, result_folder
from excite.views.style import DPI, column_width, drawing_style, literal, size_of, take_sizes
from excite.views.view import View, view_of
from regressors.arguments import checked
from regressors.errors import InputError, printable
from regressors.samples import Array


@checked
def draw(result: Any, *, width: str = "screen") -> dict[str, Any]:
    """Draw every figure of a design, a result or another object, without writing a file.

    Parameters
    ----------
    result : Design, Identification, Verification, TimeStudy, FrictionPlan, FrictionFit, PayloadMotion or SweepTable
        New, or, of designs and identifications, loaded; of a loaded identification only the parameters can be drawn.
    width : {"screen", "single", "double"}
        As wide as they like, one column of a paper (3.5 in), or both (7.16 in); with fewer panels side by side, and in
        the fonts and sizes of ``excite/views/styles/WIDTH.mplstyle``.

    Returns
    -------
    dict of str to matplotlib.figure.Figure
        By the names that their files would have. They belong to no window and no global list: none need be closed.

    Raises
    ------
    InputError
        Another width, or nothing that has figures.
    """
    return drawn_figures(lambda: {each.ending: each.draw() for each in _view_of(result).figures}, width)


@checked
def write_figures(
    design: Any, folder: str | Path, *, formats: str | Sequence[str] = ("png",), width: str = "screen"
) -> list[Path]:
    """Draw every figure of a design, or of whatever else `excite.draw` draws, and write them all at once.

    Parameters
    ----------
    design : Design, Identification, Verification, TimeStudy, FrictionPlan, FrictionFit, PayloadMotion or SweepTable
    folder : path
        An existing folder; where it holds what is drawn, its manifest lists the figures too.
    formats : str or sequence of str
        Of ``png``, ``pdf`` (TrueType fonts embedded) and ``svg`` (text that can be edited).
    width : {"screen", "single", "double"}
        See `excite.draw`.

    Returns
    -------
    list of Path
        ``motion.png``, ``phase.png``, ``spectrum.png`` and ``convergence.png`` in the folder, and those of distances
        and of the precision that the design has besides. Or those of other formats, or of another object.

    Raises
    ------
    InputError
        Another format or width, or nothing that has figures; or the folder is being written by another process, or
        cannot be written to.
    """
    view = _view_of(design)
    return write_figure_files(view.drawn, folder, view.filed, formats=formats, width=width)


def _view_of(result: Any) -> View:
    view = view_of(result)
    if not (view.figures or view.filed):
        raise InputError(f"{view.kind} {view.title} has no figures")
    return view


Draw = Callable[[], Mapping[str, Figure]]  # makes figures by their names

_UNDATED: dict[str, dict[str, Any]] = {"png": {}, "pdf": {"CreationDate": None}, "svg": {"Date": None, "Creator": None}}
_PNG_COMPRESSION = 3  # of 9; the default, 6, takes half as long again for files that are little smaller
_PNG_FONTS: Any = {"font.sans-serif": ["DejaVu Sans"]}  # matplotlib brings it along; others, for SVG, are looked up


def drawn_figures(draw: Draw, width: str) -> dict[str, Figure]:
    """Draw figures in the style of a width, with all text literal."""
    with drawing_style(width):
        figures = dict(draw())
        for figure in figures.values():
            literal(figure)
            take_sizes(figure)
    return figures


def write_figure_files(
    draw: Draw, folder: str | Path, kind: str = "", *, formats: str | Sequence[str] = ("png",), width: str = "screen"
) -> list[Path]:
    """Write figures, all at once, beside the files of a result; the same figures give the same bytes."""
    folder, formats = Path(folder), check_formats(formats)
    made = drawn_figures(draw, width)
    names = figure_names(made, formats)
    if not folder.is_dir():
        raise InputError(f"cannot write {folder / names[0]}: there is no folder {folder}")
    with (
        drawing_style(width),
        result_folder(folder),
        _saying_what_is_saved(folder, kind),
        amend_result(folder, kind) as staged,
    ):
        for name, figure in made.items():
            for form in sorted(formats, key="png".__eq__):  # for which the figure is used up
                with replacing(staged / f"{name}.{form}", "wb") as stream:
                    _save(figure, stream, form)
            _release(figure)
    return [folder / name for name in names]


def _save(figure: Figure, stream: IO[bytes], form: str) -> None:
    if form != "png":
        figure.savefig(stream, format=form, metadata=_UNDATED[form])
        return
    with rc_context(_PNG_FONTS):
        canvas = _placed(figure, FigureCanvasAgg, size_of("savefig.dpi"))
        canvas.print_png(stream, metadata=_UNDATED[form], pil_kwargs={"compress_level": _PNG_COMPRESSION})


def _release(figure: Figure) -> None:
    """Take a figure apart: its parts refer to each other, and their memory would wait for the collector."""
    for part in (part for ax in figure.axes for part in (ax.xaxis, ax.yaxis, ax)):
        vars(part).clear()  # `Figure.clear` would make new ones


def _placed(figure: Figure, canvas_of: Callable[[Figure], Any], dpi: float) -> Any:
    """The canvas of a file, with the panels placed as it measures text; `savefig` would draw everything twice for that.

    The figure is of no use for other files then.
    """
    figure.dpi = dpi
    canvas, engine = canvas_of(figure), figure.get_layout_engine()
    if engine is not None:
        for axis in (axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis) if not axis.label.get_text()):
            axis.set_label_coords(0.5, 0.5)  # to find a place beside the numbers takes longer than to draw them
        # in a column, what is written at the ends of curves may reach further when the panel is narrower
        for ax in figure.axes:
            if ax.get_axes_locator() is None and (column_width() == float("inf") or not ax.texts):
                ax.get_tightbbox = partial(_around, ax, type(ax).get_tightbbox, [])  # type: ignore[method-assign]
        engine.execute(figure)
        for ax in figure.axes:
            vars(ax).pop("get_tightbbox", None)  # that of its class is back
        figure.set_layout_engine("none")
    return canvas


def _around(ax: Axes, measure: Any, known: list[Array], renderer: Any, **how: Any) -> Bbox:
    """Bounding box of a panel with its text, measured once: the layout asks again when it has moved the panel."""
    ax.apply_aspect()
    if not known:
        beside = [*ax.texts, *filter(None, [ax.get_legend()])]  # curves end at the panel's edge
        known.append(np.subtract(measure(ax, renderer, bbox_extra_artists=beside, **how).extents, ax.bbox.extents))
    return Bbox.from_extents(*np.add(ax.bbox.extents, known[0]))


@contextmanager
def _saying_what_is_saved(folder: Path, kind: str) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        if kind not in read_manifest(folder):
            raise
        raise InputError(f"{error}; everything but the figures is saved in {folder}") from error


LONG = 6000  # points that a curve has where it bends; a longer one is a picture
_PIXELS = 1.35  # of a page, per point of a figure
FONTS = "DejaVu Sans, Verdana, Arial, sans-serif"
_FONT = re.compile(r"(?P<style>italic |oblique )?(?P<weight>bold |\d{3} )?(?P<size>[\d.]+)px (?P<family>.+)", re.DOTALL)
_DIGITS = re.compile(r"(?<=\.\d\d)\d+")  # behind the decimal point: two are a hundredth of a point
_SHORTENED = ("d", "transform", "x", "y", "points")
_LEFT_OUT = ("metadata", "style")
_SVG: Any = {"svg.fonttype": "none", "svg.hashsalt": "excite", "text.hinting": "none"}  # browsers place letters freely


def svg_text(figure: Figure, prefix: str, label: str) -> str:
    """A figure as an ``<svg>`` element without inline styles, to stand in a page; very long curves are pictures."""
    literal(figure)
    stream = io.StringIO()
    with rc_context(_SVG):
        canvas = _placed(figure, partial(_page_canvas, stream), FigureCanvasSVG.fixed_dpi)
        for line in (line for ax in figure.axes for line in ax.lines):
            path, place = line.get_path(), line.get_transform()
            line.set_rasterized(len(path) > LONG and len(path.cleaned(place, simplify=True)) > LONG)
        figure.draw(canvas.get_renderer())
        canvas.get_renderer().finalize()
    _release(figure)
    return _element(stream.getvalue(), prefix, label)


def _page_canvas(stream: IO[str], figure: Figure) -> Any:
    """A canvas for SVG whose renderer, which measures each text once, draws and lays out."""
    canvas: Any = FigureCanvasSVG(figure)
    (width, height), size = figure.get_size_inches(), figure.bbox.size
    vectors = RendererSVG(*size, stream, image_dpi=DPI, metadata=_UNDATED["svg"])  # type: ignore[no-untyped-call]
    renderer = MixedModeRenderer(figure, width, height, DPI, vectors)  # type: ignore[no-untyped-call]
    canvas.get_renderer = lambda: renderer
    return canvas


def _element(text: str, prefix: str, label: str) -> str:
    root = ElementTree.fromstring(text)
    for element in root.iter():
        for child in [child for child in element if _plain(child.tag) in _LEFT_OUT]:
            element.remove(child)
        element.tag = _plain(element.tag)
        given = dict(element.attrib)
        element.attrib.clear()
        for name, value in _attributes(given):
            element.set(name, _shortened(value) if name in _SHORTENED else _of_page(name, value, prefix))
        if element.text is not None and not element.text.strip():
            element.text = None
        element.tail = None
    for name in ("width", "height", "version"):
        root.attrib.pop(name, None)
    root.set("width", f"{_PIXELS * float(root.attrib['viewBox'].split()[2]):.0f}")
    root.attrib |= {"role": "img", "aria-label": printable(label), "font-family": FONTS}
    root.attrib |= {"stroke-linejoin": "round", "stroke-linecap": "butt"}  # of all elements, as in the style left out
    return ElementTree.tostring(root, encoding="unicode", short_empty_elements=False)


def _plain(name: str) -> str:
    """The name without its namespace, which HTML knows by itself."""
    return name.rpartition("}")[2]


def _attributes(given: dict[str, str]) -> Iterator[tuple[str, str]]:
    for name, value in given.items():
        if name == "style":
            declared = (each.partition(":") for each in value.split(";") if ":" in each)
            yield from (pair for key, _, each in declared for pair in _of_style(key.strip(), each.strip()))
        else:
            yield _plain(name), value


def _of_style(name: str, value: str) -> list[tuple[str, str]]:
    """A CSS declaration as attributes of the same name; ``font`` in its parts; the family is that of the root."""
    if name == "font-family":
        return []
    font = _FONT.fullmatch(value) if name == "font" else None
    if font is None:
        return [(name, value)]
    parts = {"font-style": font["style"], "font-weight": font["weight"], "font-size": font["size"]}
    return [(part, each.strip()) for part, each in parts.items() if each]


def _of_page(name: str, value: str, prefix: str) -> str:
    """An identifier, or a reference to one, as unique as the prefix."""
    if name == "id":
        return f"{prefix}-{value}"
    if name == "href" and value.startswith("#"):
        return f"#{prefix}-{value[1:]}"
    return value.replace("url(#", f"url(#{prefix}-")


def _shortened(text: str) -> str:
    return _DIGITS.sub("", " ".join(text.split()))
