"""Figures as files of each format and width: read back by other programs, the same bytes every time."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import zlib
from pathlib import Path
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from commands import ENVIRONMENT
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

import excite
from excite.registry import FIGURE_FORMATS, FIGURE_WIDTHS
from excite.storage.manifest import read_manifest
from excite.storage.result_folder import replace_result, result_folder
from excite.views.figure_files import drawn_figures, write_figure_files
from excite.views.panels import Panel, head, legend_below, panels, value_axis
from excite.views.style import BLUE, STYLES, drawing_style
from regressors.errors import InputError

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
    assert box is not None
    assert float(box[1]) == pytest.approx(72 * 3.5)
    assert b"/FontFile2" in content
    assert b"/Type3" not in content
    assert b"/CreationDate" not in content


@pytest.mark.skipif(shutil.which("pdffonts") is None, reason="pdffonts of poppler-utils is not installed")
def test_poppler_finds_the_fonts_embedded(files: dict[str, bytes], tmp_path: Path) -> None:
    (tmp_path / "small.pdf").write_bytes(files["pdf"])
    shown = subprocess.run(["pdffonts", "small.pdf"], cwd=tmp_path, capture_output=True, text=True, check=True)
    fonts = shown.stdout.splitlines()[2:]
    assert fonts
    assert all("TrueType" in font and "DejaVu" in font and " yes yes yes " in font for font in fonts), shown.stdout


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
        assert box is not None
        assert figure.bbox.padded(1.0).containsx(box.x0)
        assert figure.bbox.padded(1.0).containsx(box.x1)
        assert figure.bbox.containsy(box.y0)
        assert figure.bbox.containsy(box.y1)
    boxes = [ax.get_tightbbox() for ax in figure.axes]
    for k, box in enumerate(boxes):
        assert box is not None
        assert box.count_overlaps([other for other in boxes[:k] if other is not None]) == 0, k


@pytest.mark.slow
def test_panels_keep_their_order_and_rows_without_room_are_broken() -> None:
    single, double = (drawn_figures(small, width)["small"] for width in ("single", "double"))
    assert len({round(ax.get_position().y0, 6) for ax in double.axes}) == 1
    rows = [round(ax.get_position().y0, 6) for ax in single.axes]
    assert len(set(rows)) > 1
    assert rows == sorted(rows, reverse=True)


def test_a_screen_has_todays_sizes() -> None:
    (figure,) = small().values()
    size = tuple(figure.get_size_inches())
    assert tuple(drawn_figures(small, "screen")["small"].get_size_inches()) == size


def test_every_width_but_the_screen_has_a_style_of_its_own() -> None:
    assert {path.stem for path in STYLES.glob("*.mplstyle")} == set(FIGURE_WIDTHS)
    with drawing_style("single"):
        assert matplotlib.rcParams["font.size"] == 7


# Bad input


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"formats": ("jpg",)}, r"expected `formats` to be some of png, pdf, svg; given 'jpg'"),
        ({"formats": ("png", "PDF")}, "given 'PDF'"),
        ({"formats": ()}, "given none"),
        ({"formats": "none"}, "given 'none'"),
        ({"width": "wide"}, "expected `width` to be one of screen, single, double, given 'wide'"),
        ({"width": "a\x1b[31m" * 99}, "given 'a"),
    ],
)
def test_bad_formats_and_widths_are_refused(how: dict[str, object], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        write_figure_files(small, tmp_path, **how)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_one_format_may_stand_alone_and_none_twice(tmp_path: Path) -> None:
    assert [path.name for path in write_figure_files(small, tmp_path, formats="svg")] == ["small.svg"]
    paths = write_figure_files(small, tmp_path, formats=("svg", "png", "svg"))
    assert [path.name for path in paths] == ["small.svg", "small.png"]


@pytest.mark.parametrize("given", [3, None, "designs/irp6", {}])
def test_what_has_no_figures_is_refused(given: object, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a design, an identification"):
        excite.draw(given)
    with pytest.raises(InputError, match="expected a design, an identification"):
        excite.write_figures(given, tmp_path)


# Files of a result


def test_a_manifest_lists_figures_and_stale_ones_leave(tmp_path: Path) -> None:
    def result(text: str, formats: tuple[str, ...]) -> set[str]:
        with result_folder(tmp_path):
            with replace_result(tmp_path, "x", figures=formats) as staged:
                (staged / "x.json").write_text(text)
            if formats:
                write_figure_files(small, tmp_path, "x", formats=formats)
        entry = read_manifest(tmp_path)["x"]
        assert entry.figures == formats
        found = {path.name for path in tmp_path.iterdir() if not path.name.startswith(".")}
        assert found == {*entry.files, "manifest.json"}
        return found - {"x.json", "manifest.json"}

    assert result("first", ("png",)) == {"small.png"}
    assert result("second", ("pdf", "svg")) == {"small.pdf", "small.svg"}
    assert result("third", ()) == set()
