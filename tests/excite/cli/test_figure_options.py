"""``--figures`` and ``--figure-width`` of every command that draws."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import click
import pytest
from commands import ENVIRONMENT, Here, files_below

from excite.cli.main import cli
from excite.cli.option_types import Formats
from excite.files.resumed_search import holds_unfinished_design
from excite.storage.result_folder import replace_result, result_folder

COMMANDS = ("design", "identify", "verify", "study", "friction plan", "friction fit", "payload design")
MODULES = (
    "cli.design_run",
    "cli.identify_run",
    "cli.verify_command",
    "cli.study_command",
    "cli.friction_plan_command",
    "cli.friction_fit_command",
    "cli.payload_design_command",
    "files.design_folder",
    "storage.records",
)
QUICK = ("design", "irp6", "--starts", "1", "--harmonics", "3", "--period", "4", "--executor", "serial", "--out", "out")


def command_of(name: str) -> click.Command:
    command: click.Command | None = cli
    for word in name.split():
        assert isinstance(command, click.Group)
        command = command.get_command(click.Context(command), word)
    assert command is not None
    return command


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_that_draws_has_both_options(name: str) -> None:
    options = {option.name: option for option in command_of(name).params}
    default = () if name == "payload design" else ("png",)
    assert Formats().convert(options["figures"].default, None, None) == default
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
    assert Formats().convert(text, None, None) == formats


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
def test_what_is_no_format_is_refused(
    options: tuple[str, ...],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    ended = Here(tmp_path, monkeypatch, capfd).run(*QUICK, *options)
    assert ended.returncode == 2
    assert message in ended.stderr
    assert len(ended.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


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
def test_other_figures_are_no_other_problem(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    here, problems = Here(tmp_path, monkeypatch, capfd), set()
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
