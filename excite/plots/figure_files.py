"""Writing of figures to files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from excite.plots.style import drawing_style, literal, size_of, take_sizes
from excite.storage.atomic import replacing
from excite.storage.figure_names import check_formats, figure_names
from excite.storage.manifest import read_manifest
from excite.storage.result_folder import amend_result, result_folder
from regressors.errors import InputError

_UNDATED: dict[str, dict[str, Any]] = {
    "png": {},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None, "Creator": None},
}
_PNG_COMPRESSION = 3  # of 9; the default, 6, takes half as long again for files that are little smaller
_PNG_FONTS: Any = {"font.sans-serif": ["DejaVu Sans"]}  # matplotlib brings it along; others, for SVG, are looked up


def drawn_figures(draw: Callable[[], Mapping[str, Figure]], width: str = "screen") -> dict[str, Figure]:
    """Draw figures in the style of a width, with all text literal."""
    with drawing_style(width):
        figures = dict(draw())
        for figure in figures.values():
            literal(figure)
            take_sizes(figure)
    return figures


def write_figure_files(
    figures: Mapping[str, Figure] | Callable[[], Mapping[str, Figure]],
    folder: str | Path,
    kind: str = "",
    *,
    formats: str | Sequence[str] = ("png",),
    width: str = "screen",
) -> list[Path]:
    """Write figures, all at once, beside the files of a result that are there already.

    The same figures give the same bytes: files hold no dates, and identifiers do not change.
    """
    folder, formats = Path(folder), check_formats(formats)
    made = drawn_figures(figures, width) if callable(figures) else _literal(figures)
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
            for form in formats:
                with replacing(staged / f"{name}.{form}", "wb") as stream:
                    _save(figure, stream, form)
    return [folder / name for name in names]


def _literal(figures: Mapping[str, Figure]) -> Mapping[str, Figure]:
    for figure in figures.values():
        literal(figure)
    return figures


def _save(figure: Figure, stream: IO[bytes], form: str) -> None:
    if form != "png":
        figure.savefig(stream, format=form, metadata=_UNDATED[form])
        return
    with rc_context(_PNG_FONTS), _laid_out(figure):
        figure.savefig(stream, format=form, metadata=_UNDATED[form], pil_kwargs={"compress_level": _PNG_COMPRESSION})


@contextmanager
def _laid_out(figure: Figure) -> Iterator[None]:
    """Place a figure's panels at the resolution of its file; `savefig` would draw everything once more for that."""
    engine = figure.get_layout_engine()
    if engine is None:
        yield
        return
    canvas, dpi = figure.canvas, figure.dpi
    FigureCanvasAgg(figure)
    figure.dpi = size_of("savefig.dpi")
    try:
        engine.execute(figure)
        figure.set_layout_engine("none")
        yield
    finally:
        figure.set_layout_engine(engine)
        figure.dpi = dpi
        figure.set_canvas(canvas)


@contextmanager
def _saying_what_is_saved(folder: Path, kind: str) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        if kind not in read_manifest(folder):
            raise
        raise InputError(f"{error}; everything but the figures is saved in {folder}") from error
