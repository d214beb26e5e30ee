"""``--figures`` and ``--figure-width`` of every command that draws."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from commands import COMMANDS, ENVIRONMENT, Here, files_below

from excite.cli.option_types import FORMATS
from excite.design.resumed_search import holds_unfinished_design
from excite.storage.result_folder import replace_result, result_folder

DRAWING = {name: each for name, each in COMMANDS.items() if any(p.name == "figures" for p in each.params)}
MODULES = (
    "cli.design_run",
    "cli.identify_run",
    "cli.verify_run",
    "cli.study_run",
    "cli.friction_run",
    "cli.payload_run",
    "design.design_folder",
    "storage.records",
)
QUICK = ("design", "irp6", "--starts", "1", "--harmonics", "3", "--period", "4", "--executor", "serial", "--out", "out")


def test_every_command_that_draws_has_both_options() -> None:
    assert len(DRAWING) >= 8
    for name, command in DRAWING.items():
        options = {option.name: option for option in command.params}
        default = () if name == "payload design" else ("png",)
        assert FORMATS.convert(options["figures"].default, None, None) == default
        assert options["figure_width"].default == "screen"


@pytest.mark.parametrize(
    ("text", "formats"),
    [
        ("none", ()),
        ("pdf", ("pdf",)),
        ("pdf,png", ("pdf", "png")),
        (" svg , pdf", ("svg", "pdf")),
        ("png,png", ("png",)),
    ],
)
def test_formats_are_separated_by_commas(text: str, formats: tuple[str, ...]) -> None:
    assert FORMATS.convert(text, None, None) == formats


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--figures", "jpg"), "expected none, or some of png, pdf, svg separated by commas; given 'jpg'"),
        (("--figures", "PNG"), "given 'PNG'"),
        (("--figures", ""), "given ''"),
        (("--figures", "png,"), "given 'png,'"),
        (("--figures", "none,png"), "given 'none,png'"),
        (("--figures", "png\x1b[31m"), r"given 'png\x1b[31m'"),
        (("--figure-width", "3.5"), "'3.5' is not one of 'screen', 'single', 'double'"),
        (("--figure-width", ""), "is not one of"),
    ],
)
def test_what_is_no_format_is_refused(options: tuple[str, ...], message: str, here: Here) -> None:
    assert message in here.refused(*QUICK, *options)


@pytest.mark.slow
def test_no_command_imports_matplotlib_before_it_draws() -> None:
    imports = ", ".join(f"excite.{module}" for module in MODULES)
    code = f"import sys, {imports}; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], env=ENVIRONMENT, check=False).returncode == 0


RUN = "import sys; from excite.cli.main import cli; cli.main(sys.argv[1:], standalone_mode=False)"


@pytest.mark.slow
@pytest.mark.parametrize(("figures", "drawn"), [("none", False), ("svg", True)])
def test_without_figures_matplotlib_stays_out(figures: str, drawn: bool, tmp_path: Path) -> None:
    code = f"import atexit, sys; atexit.register(lambda: print('matplotlib' in sys.modules, file=sys.stderr)); {RUN}"
    command = [sys.executable, "-c", code, *QUICK, "--figures", figures]
    ended = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert ended.stderr.splitlines()[-1] == str(drawn)
    assert any(name.endswith(".svg") for name in files_below(tmp_path / "out")) == drawn
    assert not any(name.endswith(".png") for name in files_below(tmp_path / "out"))


@pytest.mark.slow
def test_other_figures_are_no_other_problem(here: Here) -> None:
    tmp_path, problems = here.cwd, set()
    cases = {
        ("--figures", "none"): set(),
        ("--figures", "pdf,svg", "--force"): {".pdf", ".svg"},
        ("--force",): {".png"},
    }
    for options, expected in cases.items():
        assert here.run(*QUICK, *options).returncode == 0
        content = json.loads((tmp_path / "out" / "design.json").read_text())
        problems.add(content["provenance"]["problem"])
        assert {Path(name).suffix for name in files_below(tmp_path / "out")} - {"", ".json", ".csv"} == expected
    assert len(problems) == 1


@pytest.mark.parametrize(
    ("asked", "there", "unfinished"),
    [
        (("png",), (), True),
        (("png",), ("motion.png",), False),
        (("pdf", "svg"), (), True),
        (("pdf", "svg"), ("motion.svg",), False),
        ((), (), False),
        (None, (), True),
        (None, ("motion.png",), False),
        (None, ("motion.pdf",), False),
    ],
)
def test_a_design_is_finished_with_the_figures_that_were_asked_for(
    asked: tuple[str, ...] | None, there: tuple[str, ...], unfinished: bool, tmp_path: Path
) -> None:
    with result_folder(tmp_path), replace_result(tmp_path, "design", figures=asked) as staged:
        (staged / "design.json").write_text('{"interrupted": false}')
    for name in there:
        (tmp_path / name).write_bytes(b"")
    assert holds_unfinished_design(tmp_path) == unfinished
