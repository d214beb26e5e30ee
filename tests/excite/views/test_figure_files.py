"""Figures as files and in pages: formats, widths, texts of others, colours, labels of parameters."""

from __future__ import annotations

import colorsys
import itertools
import re
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from commands import ENVIRONMENT
from hypothesis import given, strategies as st
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

import excite
from excite.information.target import target_of
from excite.registry import FIGURE_FORMATS
from excite.tasks.task import Task
from excite.views import style
from excite.views.figures import LONG, drawn_figures, svg_text, write_figure_files
from excite.views.panels import (
    LINES,
    Panel,
    head,
    legend_below,
    panels,
    parameter_label,
    row_places,
    unit_patches,
    value_axis,
    wrapped_sum,
)
from excite.views.style import BLUE, figure_of, plain, typeset
from regressors.errors import InputError
from regressors.readers.library import load_robot

# Figures as files of each format and width: read back by other programs, the same bytes every time.


INCHES = {"single": 3.5, "double": 7.16}
SVG = "{http://www.w3.org/2000/svg}"


def small() -> dict[str, Figure]:
    """One figure with four panels in a row, with text that has no room in a column."""
    figure, (row,) = panels(1, Panel(widths=(3.0,) * 4, height=1.2), "a long heading of a small figure " * 2)
    for ax in row:
        time = np.linspace(0.0, 8.0, 50)
        (line,) = ax.plot(time, np.sin(time), color=BLUE, linewidth=1.4, label="$x")
        value_axis(ax, "acceleration [rad/s^2]")
        head(ax, "joint_with_a_name", "limit 2.175: 99.9 % used")
        ax.set_xlabel("time [s]")
    legend_below(figure, [line] * 4)
    return {"small": figure}


def written(folder: Path, width: str = "single") -> dict[str, bytes]:
    """The figure in every format."""
    paths = write_figure_files(small, folder, formats=FIGURE_FORMATS, width=width)
    assert [path.name for path in paths] == [f"small.{form}" for form in FIGURE_FORMATS]
    return {path.suffix[1:]: path.read_bytes() for path in paths}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return written(tmp_path_factory.mktemp("single"))


def pdf_text(content: bytes) -> bytes:
    """A PDF with its compressed parts unpacked."""
    parts = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", content, re.DOTALL)
    unpacked = [zlib.decompress(part) for part in parts if part[:1] == b"x"]
    return b"\n".join([content, *unpacked])


def test_a_png_is_as_wide_as_the_column(files: dict[str, bytes], tmp_path: Path) -> None:
    (tmp_path / "small.png").write_bytes(files["png"])
    with Image.open(tmp_path / "small.png") as image:
        assert image.width == 3.5 * 600
        assert image.info["dpi"] == pytest.approx((600, 600), rel=1e-3)
        assert np.ptp(np.asarray(image.convert("L"))) > 200


def test_a_pdf_is_as_wide_as_the_column_and_embeds_truetype_fonts(files: dict[str, bytes]) -> None:
    content = pdf_text(files["pdf"])
    box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", content)
    assert float(box[1]) == pytest.approx(72 * 3.5)
    assert b"/FontFile2" in content
    assert b"/Type3" not in content
    assert b"/CreationDate" not in content


def test_an_svg_is_as_wide_as_the_column_and_has_its_text(files: dict[str, bytes]) -> None:
    root = ElementTree.fromstring(files["svg"])
    assert root.tag == f"{SVG}svg"
    assert float(str(root.get("width")).removesuffix("pt")) == pytest.approx(72 * 3.5)
    texts = {"".join(text.itertext()) for text in root.iter(f"{SVG}text")}
    assert {"joint_with_a_name", "time [s]", "$x"} <= texts
    assert b"<dc:date>" not in files["svg"]


@pytest.mark.slow
def test_another_process_writes_the_same_bytes(files: dict[str, bytes], tmp_path: Path) -> None:
    code = (
        "import importlib.util as u, pathlib, sys; sys.path.insert(0, sys.argv[2]); "
        "s = u.spec_from_file_location('formats', sys.argv[1]); m = u.module_from_spec(s); "
        "s.loader.exec_module(m); m.written(pathlib.Path('.'))"
    )
    builders = str(Path(__file__).parents[2] / "builders")
    command = [sys.executable, "-c", code, __file__, builders]
    subprocess.run(command, cwd=tmp_path, env={**ENVIRONMENT, "PYTHONHASHSEED": "7"}, check=True)
    assert {form: (tmp_path / f"small.{form}").read_bytes() for form in FIGURE_FORMATS} == files


@pytest.mark.slow
def test_the_same_figure_has_the_same_bytes_whatever_the_users_style(files: dict[str, bytes], tmp_path: Path) -> None:
    with matplotlib.rc_context({"font.size": 30, "lines.linewidth": 9, "savefig.bbox": "tight", "pdf.fonttype": 3}):
        assert written(tmp_path) == files
        assert matplotlib.rcParams["font.size"] == 30


# Widths


@pytest.mark.slow
@pytest.mark.parametrize("width", INCHES)
def test_a_column_sets_width_fonts_and_lines(width: str) -> None:
    figure = drawn_figures(small, width)["small"]
    assert figure.get_figwidth() == INCHES[width]
    sizes = {text.get_fontsize() for text in figure.findobj(Text) if text.get_text().strip()}
    assert sizes == {6.5, 7.0, {"single": 8.0, "double": 9.0}[width]}
    figure.draw_without_rendering()
    for ax in figure.axes:
        assert ax.lines[0].get_linewidth() == pytest.approx(1.0)
        box = ax.get_tightbbox()
        assert all(map(figure.bbox.padded(1.0).containsx, (box.x0, box.x1)))
        assert all(map(figure.bbox.containsy, (box.y0, box.y1)))
    boxes = [ax.get_tightbbox() for ax in figure.axes]
    assert [box.count_overlaps(boxes[:k]) for k, box in enumerate(boxes)] == [0] * len(boxes)


@pytest.mark.slow
def test_panels_keep_their_order_and_rows_without_room_are_broken() -> None:
    single, double = (drawn_figures(small, width)["small"] for width in ("single", "double"))
    assert len({round(ax.get_position().y0, 6) for ax in double.axes}) == 1
    rows = [round(ax.get_position().y0, 6) for ax in single.axes]
    assert len(set(rows)) > 1
    assert rows == sorted(rows, reverse=True)


# Bad input


BAD: tuple[tuple[dict[str, Any], str], ...] = (
    ({"formats": ("jpg",)}, r"expected `formats` to be some of png, pdf, svg; given 'jpg'"),
    ({"formats": ()}, "given none"),
    ({"width": "wide"}, "expected `width` to be one of screen, single, double, given 'wide'"),
)


def test_bad_formats_and_widths_are_refused(tmp_path: Path) -> None:
    for how, message in BAD:
        with pytest.raises(InputError, match=message):
            write_figure_files(small, tmp_path, **how)
    assert list(tmp_path.iterdir()) == []
    paths = write_figure_files(small, tmp_path, formats=("svg", "pdf", "svg"))
    assert [path.name for path in paths] == ["small.svg", "small.pdf"]


def test_what_has_no_figures_is_refused(tmp_path: Path) -> None:
    for wrong in (3, None, "designs/irp6", {}):
        with pytest.raises(InputError, match="expected a design, an identification"):
            excite.draw(wrong)
        with pytest.raises(InputError, match="expected a design, an identification"):
            excite.write_figures(wrong, tmp_path)


# Names of others in figures: dollar signs are no formulas, control characters no glyphs.


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["$", "$x^$", r"$\frac{1}{", "a\x1b[31m", "\x00", r"\$", "{", "a_{", "%", "\u202e"])
def test_no_name_breaks_a_figure(tmp_path: Path, name: str) -> None:
    figure = figure_of(3.0, 2.0, name)
    ax = figure.subplots()
    ax.plot([0, 1], [0, 1], label=name)
    ax.set_title(name)
    ax.set_ylabel(f"{name} [Nm]")
    ax.annotate(name, (0.5, 0.5))
    ax.set_yticks([0.0], [plain(name)])
    ax.legend()
    (path,) = write_figure_files(lambda: {"figure": figure}, tmp_path)
    assert path.stat().st_size > 1000


# Figures as SVG in pages: identifiers of their own, no styles, texts as they are, and never huge.


def figure(points: int = 10, title: str = "title") -> Figure:
    made = Figure(figsize=(3.0, 2.0))
    ax = made.subplots()
    ax.plot(np.arange(points), np.random.default_rng(0).normal(size=points), "o-", label="curve")
    ax.set_title(title, fontweight="bold", fontstyle="italic")
    ax.legend()
    return made


@pytest.mark.parametrize("name", ['<script>x</script> style="a:b" id="c"', "a & b", "$x$", "\x1b[31m"])
def test_names_are_texts(name: str) -> None:
    root = ElementTree.fromstring(svg_text(figure(title=name), "p", name))
    shown = [each.text for each in root.iter("text")]
    assert name.replace("\x1b", "\\x1b") in shown
    assert not list(root.iter("script"))


def test_long_curves_become_a_picture() -> None:
    text = svg_text(figure(4 * LONG), "p", "l")
    assert len(text) < 100 * LONG
    images = ElementTree.fromstring(text).iter("image")
    assert {str(each.get("href")).partition(";")[0] for each in images} == {"data:image/png"}


# Colours of figures on a dark page: readable, of the same hue, and still different from each other.


PAGE_STYLE = (Path(style.__file__).parent / "page" / "style.css").read_text()


def _hue(colour: str) -> float:
    return colorsys.rgb_to_hsv(*(int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)))[0]


def contrast(one: str, other: str) -> float:
    """Contrast ratio of WCAG 2, from 1 to 21, by the relative luminance of both."""
    rgb = np.array([[int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)] for colour in (one, other)])
    light = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    low, high = sorted((light @ [0.2126, 0.7152, 0.0722]).tolist())
    return (high + 0.05) / (low + 0.05)


def dark(colour: str) -> str:
    """The colour as the filter of the page's style shows it, by the matrix of CSS Filter Effects, section 9.6."""
    (css,) = re.findall(r"filter: invert\((\.\d+)\) hue-rotate\(180deg\)", PAGE_STYLE)
    rgb = float(css) + (1 - 2 * float(css)) * np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    weights = np.array([0.213, 0.715, 0.072])
    light = (2 * np.outer(np.ones(3), weights) - np.eye(3)) @ rgb
    return "#" + "".join(f"{round(255 * float(x)):02x}" for x in light.clip(0.0, 1.0))


def test_colours_keep_their_meaning_on_a_dark_page() -> None:
    card = dark("#ffffff")
    for colour in style.COLOURS:
        assert contrast(dark(colour), card) >= 3.0
        assert abs(_hue(dark(colour)) - _hue(colour)) < 0.06
    for one, other in itertools.combinations(map(dark, style.COLOURS), 2):
        assert max(abs(int(one[k : k + 2], 16) - int(other[k : k + 2], 16)) for k in (1, 3, 5)) > 40, (one, other)
    assert min(contrast(dark(colour), card) for colour in (style.DARK, "#000000")) >= 4.5  # of text
    faint = [contrast(dark(colour), card) for colour in (style.BAND, style.FORBIDDEN, "#DDDDDD", "#EDEDED")]
    assert 1.1 < min(faint) < max(faint) < 3.0


# Labels of base parameters: whole sums over several lines, rows as high as they need, a colour for each unit.


TERM = st.sampled_from(["m1", "0.106662 m4c4z", "2 d5 m5c5z", "l2^2 m3", "$a$", "a_very_long_name_of_one_term"])


@given(TERM, st.lists(st.tuples(st.sampled_from("+-"), TERM), max_size=15), st.integers(10, 80))
def test_lines_hold_every_term_once_and_in_order(first: str, others: list[tuple[str, str]], length: int) -> None:
    text = first + "".join(f" {sign} {term}" for sign, term in others)
    lines = wrapped_sum(text, length)
    assert " ".join(lines) == text
    longest = max(len(term) + 3 for term in (first, *(term for _, term in others)))
    assert all(len(line) <= max(length, longest) for line in lines)


def test_expressions_of_built_in_arms_are_whole_and_units_look_the_same_on_each() -> None:
    looks: dict[str, set[Any]] = {}
    for robot in ("irp6", "panda", "iiwa7", "ur10e", "so101"):
        base = target_of(load_robot(robot), Task(robot)).base
        for name, expression in zip(base.names, base.expressions, strict=True):
            text = parameter_label(name, expression, 42, "design.json").replace("\n", " ")
            assert text in (typeset(expression), typeset(f"{name} = {expression}"))
        for patch in unit_patches(base.units):
            looks.setdefault(str(patch.get_label()), set()).add((patch.get_facecolor(), patch.get_hatch()))
    assert {unit: len(of_unit) for unit, of_unit in looks.items()} == dict.fromkeys(looks, 1)
    assert [patch.get_label() for patch in unit_patches(["W", "kg m", "cd", "kg m"])] == ["kg m", "W, cd"]


def test_an_expression_of_too_many_lines_is_left_to_the_file() -> None:
    expression = "I2xx" + " + 0.123456 m3c3z" * 30
    assert parameter_label("I2xx", expression, 42, "design.json") == "I2xx = sum of 31 terms, in design.json"
    assert parameter_label("a", "a" + " + b" * 30, 40, "design.json").count("\n") < LINES


def test_rows_do_not_overlap() -> None:
    labels = ["a", "b\nc", "d", "e\nf\ng", "h"]
    places, height = row_places(labels)
    lines = np.array([1 + label.count("\n") for label in labels])
    assert height == pytest.approx(float(np.sum(1 + 0.67 * (lines - 1))))
    for (a, m), (b, n) in itertools.pairwise(zip(places, lines, strict=True)):
        assert b - a >= 0.5 * 0.67 * (m + n)
