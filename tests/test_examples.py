"""The examples of docs/examples: scripts print and draw what their pages show, the notebook too; parts named on the
command line, and parts that files of results name."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from commands import ENVIRONMENT, content_of, module_of, run, run_process
from recordings import REAL
from written_files import saved

import excite

DOCS = Path(__file__).resolve().parents[1] / "docs"
EXAMPLES = DOCS / "examples"
SCRIPTS = sorted(path.name for path in EXAMPLES.glob("*.py"))
PARTS = [name for name in SCRIPTS if name.startswith("own_")]
MACHINES = 0.5  # relative difference of numbers between machines
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?")
CLEAN = {**ENVIRONMENT, "PYTHONDONTWRITEBYTECODE": "1"}
IN_THIS_PROCESS: dict[str, Any] = {"starts": 1, "harmonics": 3, "executor": "serial"}


def ended(command: list[str], cwd: Path, text: str | None = None) -> subprocess.CompletedProcess[str]:
    """A process of its own, with a text typed into it, which went well."""
    process = run_process(command, cwd, CLEAN, input=text, timeout=120.0)
    assert process.returncode == 0, process.stderr
    assert "Traceback" not in process.stderr
    return process


def gallery() -> Any:
    """The extension of the site."""
    return module_of(DOCS / "extensions" / "example_gallery.py")


# Scripts


def assert_same(found: str, recorded: str) -> None:
    """The same words, and numbers of the same size.

    Rounding differs between processors, and searches amplify it: from the same seed, another machine may end in another
    of several good motions.
    """
    shown = [" ".join(text.split()) for text in (found, recorded)]
    words, expected_words = (NUMBER.sub("#", text) for text in shown)
    assert words == expected_words
    for number, expected in zip(*(NUMBER.findall(text) for text in shown), strict=True):
        unit = 10.0 ** -len(expected.partition(".")[2])
        most = max(1.5 * unit, MACHINES * abs(float(expected)))
        assert abs(float(number) - float(expected)) < most, f"{number} for {expected} in\n{found}"


@pytest.mark.parametrize("found", ["cond W = 80.7 s", "cond W = 40.9", "cond V = 40.9 s", "cond W = -40.9 s"])
def test_outputs_that_differ_are_seen(found: str) -> None:
    assert_same("cond W  = 40.8 s\n", "cond W = 40.9 s")
    with pytest.raises(AssertionError):
        assert_same(found, "cond W = 40.9 s")


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_scripts_print_and_draw_what_their_pages_show(name: str, tmp_path: Path) -> None:
    logs = []
    if name == "real_ur10e.py":
        if not REAL.is_dir():
            pytest.skip("the logs of the UR10e are not beside the repository")
        logs = [str(REAL)]
    (tmp_path / "out").mkdir()
    printed = ended([sys.executable, str(EXAMPLES / name), *logs, "out"], tmp_path).stdout
    assert_same(printed, (EXAMPLES / "printed" / f"{name[:-3]}.txt").read_text(encoding="utf-8"))
    files = [file.relative_to(tmp_path) for file in tmp_path.rglob("*") if file.is_file()]
    assert files == [Path("out", f"{name[:-3]}.png")]


def test_the_gallery_shows_every_script_with_a_small_figure() -> None:
    pytest.importorskip("sphinx", reason="the site needs Sphinx")
    shown = gallery().names_in((DOCS / "examples.md").read_text(encoding="utf-8"))
    assert sorted(shown) == [name[:-3] for name in SCRIPTS]
    for name in shown:
        example = gallery().Example.of(name)
        assert example.sentence.endswith(".")
        assert re.search(r"Takes about \d+ s\.", example.text), name
        assert gallery().figure_of(name).stat().st_size < 120_000


def test_scripts_without_what_their_pages_show_are_refused() -> None:
    pytest.importorskip("sphinx", reason="the site needs Sphinx")
    with pytest.raises(Exception, match=r"nowhere\.py is missing; python docs/draw_gallery\.py nowhere"):
        gallery().Example.of("nowhere")


# The notebook


NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))
RUN_NOTEBOOK = module_of(DOCS / "run_notebook.py")


def printed_by_cells(notebook: Any) -> list[str]:
    """What each cell with code prints."""
    return [
        "".join("".join(each["text"]) for each in cell["outputs"] if each["output_type"] == "stream")
        for cell in notebook["cells"]
        if cell["cell_type"] == "code"
    ]


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_notebooks_have_the_cells_of_their_sources(file: Path) -> None:
    cells = json.loads(file.read_text(encoding="utf-8"))["cells"]
    source = (EXAMPLES / "notebook" / f"{file.stem}.py").read_text(encoding="utf-8")
    assert [(cell["cell_type"], "".join(cell["source"])) for cell in cells] == RUN_NOTEBOOK.cells_of(source)
    assert all(cell["outputs"] for cell in cells[2:] if cell["cell_type"] == "code")
    assert not [text for cell in cells for each in cell.get("outputs", ()) if (text := each.get("name")) == "stderr"]
    assert file.stat().st_size < 400_000


@pytest.mark.slow
@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
@pytest.mark.parametrize("by", ["python", "nbclient"])
def test_notebooks_run_again_to_the_same_outputs(by: str, file: Path, tmp_path: Path) -> None:
    """As a script, which needs no package of Jupyter's, and as ``docs/run_notebook.py`` runs it."""
    source = EXAMPLES / "notebook" / f"{file.stem}.py"
    if by == "python":
        cells = [text for kind, text in RUN_NOTEBOOK.cells_of(source.read_text(encoding="utf-8")) if kind == "code"]
        (tmp_path / "cells.py").write_text("\nprint(chr(12))\n".join(cells), encoding="utf-8")
        again = ended([sys.executable, "cells.py"], tmp_path).stdout.split("\f")
    else:
        for package in ("nbclient", "ipykernel"):
            pytest.importorskip(package, reason=f"to run notebooks needs {package}, of the extra docs")
        again = printed_by_cells(RUN_NOTEBOOK.executed(source))
    recorded = printed_by_cells(json.loads(file.read_text(encoding="utf-8")))
    for found, expected in zip(again, recorded, strict=True):
        assert_same(found, expected)


def command_of(name: str) -> list[str]:
    """Arguments of the command in an example's docstring."""
    text = ast.get_docstring(ast.parse((EXAMPLES / name).read_text(encoding="utf-8")))
    (command,) = re.findall(r"``excite (\w[^`]+)``", text)
    return str(command).split()


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Log of a short search's motion, noise included."""
    design = excite.design_trajectory("irp6", **IN_THIS_PROCESS)
    file = tmp_path_factory.mktemp("log") / "run.csv"
    excite.simulate(design, noise=1.0, seed=1, rate=200.0).save(file)
    return file


@pytest.mark.slow
@pytest.mark.parametrize("name", PARTS)
def test_command_lines_of_the_examples_run(name: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    arguments = command_of(name)
    part = next(word for word in arguments if word.startswith(f"{name[:-3]}:"))
    arguments[arguments.index("--out") + 1] = str(tmp_path / "out")
    if arguments[0] == "design":
        arguments += ["--starts", "1"]
    else:
        arguments[arguments.index("run.csv")] = str(request.getfixturevalue("recorded"))
    run(*arguments, cwd=EXAMPLES, PYTHONDONTWRITEBYTECODE="1", status=0)
    assert any(part in file.read_text(encoding="utf-8") for file in (tmp_path / "out").glob("*.json"))


# Processes of the search

OWN_CRITERION = """
import os
from pathlib import Path
import excite

class Mine(excite.ConditionNumber):
    def value(self, M):
        with Path("processes").open("a") as file:
            file.write(f"{os.getpid()} ")
        return super().value(M)

search = excite.Search(starts=2, workers=2)
design = excite.design_trajectory("irp6", criterion=Mine(), harmonics=2, search=search)
print("by", os.getpid(), "feasible:", design.feasible)
"""


def typed(code: str) -> str:
    """Code as it is typed into an interactive session: an empty line ends a block, and nothing else is empty."""
    lines = [line for line in code.splitlines() if line.strip()]
    ends = (a.startswith(" ") and not b.startswith(" ") for a, b in pairwise(lines))
    return "".join(f"{line}\n\n" if end else f"{line}\n" for line, end in zip(lines, (*ends, False), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("way", ["script", "interactive session", "argument"])
def test_classes_of_the_main_module_reach_other_processes(way: str, tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(OWN_CRITERION, encoding="utf-8")
    options, text = {
        "script": (["script.py"], None),
        "interactive session": (["-i"], typed(OWN_CRITERION)),
        "argument": (["-c", OWN_CRITERION], None),
    }[way]
    shown = ended([sys.executable, *options], tmp_path, text).stdout
    (printed,) = re.findall(r"by (\d+) feasible: True", shown)  # once: no process ran the script again
    used = set((tmp_path / "processes").read_text(encoding="utf-8").split())
    assert used - {printed}  # one worker may have done both starts


# Files name parts of a user's own, and never import them


@pytest.fixture
def examples(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[[str], Any]]:
    """Imports an example; afterwards a module of that name fails if it is imported in the current folder."""
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(sys, "path", list(sys.path))

    def example(name: str) -> Any:
        monkeypatch.syspath_prepend(EXAMPLES)
        module = importlib.import_module(name)
        del sys.modules[name]
        sys.path.remove(str(EXAMPLES))
        (tmp_path / "elsewhere" / f"{name}.py").write_text("raise RuntimeError('imported')\n", encoding="utf-8")
        monkeypatch.chdir(tmp_path / "elsewhere")
        monkeypatch.syspath_prepend(os.getcwd())
        return module

    yield example
    assert not {name[:-3] for name in SCRIPTS} & set(sys.modules)


Use = Callable[[Any], Any]
JUDGED: Use = lambda design: excite.compare([design])  # noqa: E731
DESIGNED: Use = lambda design: excite.design_trajectory(design.task)  # noqa: E731


OWN_PARTS: dict[str, tuple[str, str, tuple[Any, ...], str, Use]] = {
    "criterion": ("own_criterion", "FirstThree", (), "criterion=FirstThree", JUDGED),
    "solver": ("own_solver", "RandomWalk", (5,), "solver=RandomWalk", DESIGNED),
    "trajectory": ("own_trajectory", "OddFourier", (10, 3), "trajectory=OddFourier", JUDGED),
    "constraints": ("own_constraint", "ShortHose", (), r"constraints=\[ShortHose\]", DESIGNED),
    "model": ("own_model", "DragModel", ("robot",), "model=DragModel", JUDGED),
}


@pytest.mark.slow
@pytest.mark.parametrize("option", OWN_PARTS)
def test_designs_with_own_parts_are_loaded_with_the_objects_themselves(
    option: str, examples: Callable[[str], Any], tmp_path: Path
) -> None:
    example, attribute, arguments, remedy, use = OWN_PARTS[option]
    robot = excite.load_robot("irp6")
    part = getattr(examples(example), attribute)(*(robot if given == "robot" else given for given in arguments))
    given = {option: [part] if option == "constraints" else part}
    own = {name: value for name, value in given.items() if name != "model"}
    what = given.get("model", robot)
    options = {name: value for name, value in IN_THIS_PROCESS.items() if (option, name) != ("trajectory", "harmonics")}
    design = excite.design_trajectory(what, **own, **options)
    design.save(tmp_path / "design")
    named = content_of(tmp_path / "design")["task"][option]
    assert named in (f"{example}:{attribute}", [f"{example}:{attribute}"])
    with pytest.raises(excite.InputError, match=f"imports no code that it names: .* give the object itself.*{remedy}"):
        use(excite.load_design(tmp_path / "design"))
    stored = excite.load_design(tmp_path / "design", **given)
    assert use(stored)
    assert excite.simulate(stored, rate=200.0).log.time.size > 1000


def test_designs_with_own_parts_are_played_without_them(examples: Callable[[str], Any], tmp_path: Path) -> None:
    criterion = examples("own_criterion").FirstThree()
    design = excite.design_trajectory("irp6", criterion=criterion, **IN_THIS_PROCESS)
    stored = excite.load_design(saved(tmp_path / "design", design))
    assert stored.condition_number == design.condition_number
    assert excite.simulate(stored, rate=200.0).log.time.size > 1000


@pytest.mark.slow
@pytest.mark.parametrize(
    ("example", "attribute", "option"),
    [("own_estimator", "LeastAbsolute", "estimator"), ("own_model", "DragModel", "model")],
    ids=["estimator", "model"],
)
def test_results_with_own_parts(
    example: str, attribute: str, option: str, examples: Callable[[str], Any], recorded: Path, tmp_path: Path
) -> None:
    kind = getattr(examples(example), attribute)
    robot = excite.load_robot("irp6")
    own = kind(robot) if option == "model" else kind()
    model, estimator = (own, "weighted") if option == "model" else ("irp6", own)
    log = excite.read_log(recorded)
    result = excite.identify(model, log, estimator=estimator)
    result.save(tmp_path / "result")

    def again(stored: Any) -> Any:
        return excite.identify(stored.task, log, recipe=stored.recipe)

    with pytest.raises(excite.InputError, match=f"give the object itself.*{option}={attribute}"):
        again(excite.load_result(tmp_path / "result"))
    stored = excite.load_result(tmp_path / "result", **{option: own})
    assert again(stored).coefficients == pytest.approx(result.coefficients, rel=1e-9)
    assert excite.verify(stored, log, training_too=True).relative_error < 0.1


# The page of all names.


NAMES = module_of(DOCS / "list_names.py")
LISTED = NAMES.PAGE.read_text(encoding="utf-8")


def test_the_page_of_names_has_them_all_with_their_sentences() -> None:
    assert sorted(row["name"] for row in NAMES.ROW.finditer(LISTED)) == excite.__all__
    assert NAMES.filled(LISTED) == LISTED  # docs/list_names.py writes them


@pytest.mark.slow
def test_the_lines_of_the_page_of_names_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.yaml").write_bytes((EXAMPLES / "cell.yaml").read_bytes())
    (begin,) = re.findall(r"^```python\n(.*?)^```$", LISTED, re.MULTILINE | re.DOTALL)
    space: dict[str, Any] = {}
    exec(begin, space)
    for row in NAMES.ROW.finditer(LISTED):
        example = row["example"]
        if example.startswith("not run: "):
            continue
        assert re.search(rf"`.*\b{row['name']}\b.*`", example), row["name"]
        exec(f"_ = {example.strip('`')}", space)  # names that it gives are those of later lines
        assert space["_"] is not False, row["name"]
