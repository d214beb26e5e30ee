"""Names of others in figures: dollar signs are no formulas, control characters no glyphs."""

from pathlib import Path

import pytest

from excite.views.figure_files import write_figure_files
from excite.views.style import figure_of, plain


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
    (path,) = write_figure_files({"figure": figure}, tmp_path)
    assert path.stat().st_size > 1000


def test_escaping_twice_is_escaping_once() -> None:
    assert plain(plain("a$b\x1b\nc")) == plain("a$b\x1b\nc") == "a\\$b\\x1b\nc"
