"""``import excite``: the example in its docstring, every public name, and what importing costs."""

import doctest
import re
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from commands import MODULE, SCRIPT, Here, files_below, run, run_process

import excite
from excite.cli.options import flag_of
from excite.registry import BUILT_IN, built_in
from excite.tasks.option import options_of
from excite.tasks.task import PARTS

ROOT = Path(__file__).resolve().parents[2]
HEAVY = ("casadi", "scipy", "matplotlib", "numpy", "pydantic", "ruamel", "rich", "daqp", "click")


def test_the_example_in_the_docstring() -> None:
    failed, tried = doctest.testmod(excite)
    assert (failed, tried) == (0, 5)


PAGES = (ROOT / "README.md", ROOT / "docs" / "how-to" / "python.md")
CHAINS = [
    code for page in PAGES for code in re.findall(r"^```python\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)
]


def test_examples_are_a_dozen_lines() -> None:
    assert max(len([line for line in code.splitlines() if line.strip()]) for code in CHAINS) <= 13


@pytest.mark.parametrize(
    "chain", [CHAINS[0], pytest.param(CHAINS[1], marks=pytest.mark.slow)], ids=["README.md", "python.md"]
)
def test_the_chain_in_the_documents_runs(chain: str, here: Here) -> None:
    assert {"starts=12", "harmonics=5"} <= set(re.findall(r"\w+=\d+", chain))
    quick = chain.replace("starts=12", "starts=1").replace("harmonics=5", "harmonics=3")
    quick += "\nimport sys\nprint('jax' in sys.modules)"  # only batches of repetitions need it
    assert run_script(quick, here.cwd).split()[1:] == ["True", "True", "False"]
    files = {"design.json", "trajectory.csv"} | ({"motion.png"} if "write_figures" in chain else set())
    (folder,) = re.findall(r'design\.save\("(.*?)"', chain)
    assert files <= files_below(here.cwd / folder)


@pytest.mark.slow
def test_the_identification_in_the_documents_runs(here: Here) -> None:
    here.designed("irp6", "--starts", "1", "--harmonics", "3", out="designs/irp6")
    here.run("simulate", "designs/irp6", "--rate", "200", "--out", "run.csv", status=0)
    assert len(run_script(CHAINS[2], here.cwd).splitlines()) == 13
    assert "result.json" in files_below(here.cwd / "results" / "irp6")


@pytest.mark.slow
def test_frames_in_the_documents_are_identified_from(here: Here) -> None:
    """PyArrow, which tests have, reads and makes frames in place of pandas."""
    page = (ROOT / "docs" / "how-to" / "identify.md").read_text()
    (code,) = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    of_arrow = {"import pandas": "import pyarrow.csv", "pandas.read_csv": "pyarrow.csv.read_csv"}
    for old, new in (of_arrow | {"pandas.DataFrame": "pyarrow.table"}).items():
        assert old in code
        code = code.replace(old, new)
    here.designed("irp6", "--starts", "1", "--harmonics", "3", out="designs/irp6")
    for seed, name in enumerate(("run.csv", "other.csv")):
        noise = ("--seed", str(seed), "--torque-noise", "1")
        here.run("simulate", "designs/irp6", "--rate", "200", *noise, "--out", name, status=0)
    checks = "\nimport numpy as np\nprint(table.num_rows, np.array_equal(result.coefficients, again.coefficients))"
    verdict, counted = run_script(code + checks, here.cwd).splitlines()
    assert verdict.startswith("The result predicts this log")
    assert counted == "13 True"


def run_script(code: str, cwd: Path) -> str:
    """What a script in a process of its own prints."""
    (cwd / "script.py").write_text(code)
    ended = run_process([sys.executable, "script.py"], cwd)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_public_names_are_there_and_explained() -> None:
    assert [name for name in excite.__all__ if not getattr(excite, name).__doc__ or name not in dir(excite)] == []


@pytest.mark.parametrize("kind", ["model", "trajectory", "criterion", "constraint", "estimator", "solver"])
def test_built_in_parts_are_public(kind: str) -> None:
    for name in BUILT_IN[kind]:
        part = built_in(kind, name)
        assert getattr(excite, part.__name__) is part
        assert part.__name__ in dir(excite)
        assert part.__doc__


def test_unknown_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="module 'excite' has no attribute 'desing'"):
        excite.desing  # noqa: B018


def imported(code: str, cwd: Path) -> set[str]:
    """Which of the heavy packages a fresh process has imported after some code."""
    code = f"import sys\n{code}\nprint(*({set(HEAVY)!r} & set(sys.modules)), file=sys.stderr)"
    return set(run_process([sys.executable, "-c", code], cwd, check=True).stderr.split())


def test_importing_excite_imports_nothing_heavy(tmp_path: Path) -> None:
    assert imported("import excite, excite.registry; dir(excite)", tmp_path) == set()


def test_help_imports_neither_numpy_nor_casadi(tmp_path: Path) -> None:
    lines = ("--help", "--version", "design --help", "identify -h", "compare -h", "robots -h")
    code = (
        f"from excite.cli.main import main\nfor line in {lines}:\n    sys.argv = ['excite', *line.split()]\n"
        "    try:\n        main()\n    except SystemExit as end:\n        assert not end.code"
    )
    assert imported(code, tmp_path) == {"click"}


# Help


@pytest.mark.parametrize("command", [MODULE, SCRIPT], ids=["module", "script"])
def test_help_and_version(command: list[str], tmp_path: Path) -> None:
    ended = run("--help", cwd=tmp_path, command=command, status=0, stderr="")
    for name in ("robots", "design", "compare"):
        assert re.search(rf"^  {name}  ", ended.stdout, re.MULTILINE)
    assert "130 interrupted" in ended.stdout
    assert run(cwd=tmp_path, command=command).stdout == ended.stdout  # no command at all
    shown = run("--version", cwd=tmp_path, command=command)
    assert (shown.returncode, shown.stdout) == (0, f"excite {version('excite-trajectories')}\n")


def test_help_of_design_names_every_option_of_a_task(tmp_path: Path) -> None:
    text = run("design", "--help-all", cwd=tmp_path).stdout
    for part in PARTS.values():
        for field, option in options_of(part):
            if not option.hidden:
                assert re.search(rf"{flag_of(field.name, option)}\b", text), field.name
