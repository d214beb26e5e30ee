"""``import excite``: the example in its docstring, every public name, and what importing costs."""

import dataclasses
import doctest
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from commands import ENVIRONMENT, MODULE, SCRIPT, Here, files_below, run, table_of

import excite

ROOT = Path(__file__).resolve().parents[2]
HEAVY = ("casadi", "scipy", "matplotlib", "numpy", "pydantic", "ruamel", "rich", "daqp", "click")


def test_the_example_in_the_docstring() -> None:
    failed, tried = doctest.testmod(excite)
    assert (failed, tried) == (0, 4)


def test_a_dozen_lines_of_python(tmp_path: Path) -> None:
    robot = excite.load_robot("irp6")
    task = excite.Task("irp6", starts=1, harmonics=3, executor="serial", limits=excite.LimitChoice(velocity=(0.8,)))
    design = excite.design_trajectory(task.changed(robot=robot))
    assert design.feasible
    assert design.condition_number > 1.0
    assert [parameter.unit for parameter in design.predicted]
    excite.save_design(design, str(tmp_path / "design"))
    excite.write_figures(design, tmp_path / "design")
    stored = excite.load_design(tmp_path / "design")
    assert stored.task == task
    assert {"design.json", "trajectory.csv", "motion.png"} <= files_below(tmp_path / "design")
    assert len(table_of(tmp_path / "design" / "trajectory.csv")[1]) == 1001
    model = excite.DifferentialModel(robot)
    assert excite.base_parameters(model).rank > 13
    with pytest.raises(excite.InputError, match="no robot 'nope'"):
        excite.load_robot("nope")
    assert "irp6" in excite.built_in_names()
    assert isinstance(design, excite.Design)


def test_the_examples_in_the_readme_run(here: Here) -> None:
    design, identify = re.findall(r"^```python\n(.*?)^```$", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    assert max(len([line for line in code.splitlines() if line.strip()]) for code in (design, identify)) <= 13
    assert "True" in run_script(design.replace("seed=0", "seed=0, starts=1"), here.cwd)
    assert {"design.json", "trajectory.csv", "motion.png"} <= files_below(here.cwd / "designs" / "irp6")
    assert here.run("simulate", "designs/irp6", "--rate", "200", "--out", "run.csv").returncode == 0
    assert len(run_script(identify, here.cwd).splitlines()) == 13


def run_script(code: str, cwd: Path) -> str:
    """What a script in a process of its own prints."""
    (cwd / "script.py").write_text(code)
    ended = subprocess.run(
        [sys.executable, "script.py"], cwd=cwd, env=ENVIRONMENT, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.mark.parametrize("name", excite.__all__)
def test_public_names_are_there_and_explained(name: str) -> None:
    assert getattr(excite, name).__doc__
    assert name in dir(excite)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="module 'excite' has no attribute 'desing'"):
        excite.desing  # noqa: B018


def imported(code: str, cwd: Path) -> set[str]:
    """Which of the heavy packages a fresh process has imported after some code."""
    code = f"import sys\n{code}\nprint(*({set(HEAVY)!r} & set(sys.modules)), file=sys.stderr)"
    shown = subprocess.run(
        [sys.executable, "-c", code], cwd=cwd, env=ENVIRONMENT, capture_output=True, text=True, check=True
    )
    return set(shown.stderr.split())


def test_importing_excite_imports_nothing_heavy(tmp_path: Path) -> None:
    assert imported("import excite, excite.registry; dir(excite)", tmp_path) == set()


@pytest.mark.parametrize(
    "arguments", [("--help",), ("--version",), ("design", "--help"), ("compare", "-h"), ("robots", "-h")]
)
def test_help_imports_neither_numpy_nor_casadi(arguments: tuple[str, ...], tmp_path: Path) -> None:
    code = (
        f"sys.argv = {['excite', *arguments]!r}\nfrom excite.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code"
    )
    assert imported(code, tmp_path) == {"click"}


def test_designing_needs_no_matplotlib_before_it_draws(tmp_path: Path) -> None:
    code = "import excite\nexcite.design_trajectory, excite.Task, excite.save_design, excite.load_design"
    assert "matplotlib" not in imported(code, tmp_path)


# Help


@pytest.mark.parametrize("command", [MODULE, SCRIPT], ids=["module", "script"])
def test_help_and_version(command: list[str], tmp_path: Path) -> None:
    ended = run("--help", cwd=tmp_path, command=command)
    assert (ended.returncode, ended.stderr) == (0, "")
    for name in ("robots", "design", "compare"):
        assert re.search(rf"^  {name}  ", ended.stdout, re.MULTILINE)
    assert "130 interrupted" in ended.stdout
    assert run(cwd=tmp_path, command=command).stdout == ended.stdout  # no command at all
    shown = run("--version", cwd=tmp_path, command=command)
    assert (shown.returncode, shown.stdout) == (0, f"excite {version('excite-trajectories')}\n")


def test_help_of_design_names_every_option_of_a_task(tmp_path: Path) -> None:
    text = run("design", "--help", cwd=tmp_path).stdout
    elsewhere = {"robot", "base_link", "limits"}  # the argument, --base, and four options
    for field in dataclasses.fields(excite.Task):
        if field.name not in elsewhere:
            assert re.search(rf"--{field.name.replace('_', '-')}\b", text), field.name
    for field in dataclasses.fields(excite.LimitChoice):
        assert f"--{field.name}-limit" in text
