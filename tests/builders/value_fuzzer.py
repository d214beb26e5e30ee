"""Values that users and scripts type by mistake, for every option of every command, in this process, and their judge.

The options of a command are read from click, so that a new option is covered by itself. `BUDGET` holds the values of
options that decide how long a command takes; everything else gets any value.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any
from unittest.mock import patch

import click
from commands import COMMANDS
from hypothesis import strategies as st

from excite.cli.main import main
from excite.cli.option_types import (
    PAYLOAD,
    Folder,
    Number,
    Numbers,
    PartName,
    Sides,
)
from regressors.quantities import QUANTITIES, Quantity
from regressors.work_prediction import CAP_VARIABLE

STATUSES = {0, 1, 2}
LINES = 8  # on stderr, at most: one of the error, others of notes and of progress
LONGEST = 600  # characters of an error
PATIENCE = 3.0  # seconds of processor time after which Ctrl-C is pressed, as many sizes are right and take hours
SECONDS = 10.0  # more, at most, until it has ended
CAP = 0.4  # of the memory of a command [GB]
NOT_FINITE = re.compile(r"(?<![\w.\"'])[-+]?\.?(nan|inf|infinity)(?![\w\"'])", re.I)

NASTY = (
    "0", "-0", "-0.0", "1e-300", "-1e-300", "5e-324", "1e308", "-1e308", "1e400", "nan", "-nan", "inf", "-inf", "-1",
    "1e20", "-1e20", "1" + "0" * 20, "9" * 400, "9" * 5000, "", " ", "1_0", "0x10", "1:30", "true", "1e3", "1,5",
    "\u0661", "\U0001f916", "\x1b[31m", "a" * 300, "--", "auto", "none", "all", "1e-12", "1e6", "0.5", "1", "2", "-2",
)  # fmt: skip
NAMES = (*["1", "2", "1,2", "a", "b", "z1", "z2", "all", "none", "nope", ",", "1,1", "é", "0", "3", "-1", "A", "B"], "")
JOINED = ("0", "1", "-1", "0.5", "1e-12", "1e4", "-1e4", "1e6", "1e-300", "1e308", "nan", "", "x", "1e9", "3.14159")
# options that decide how long a command takes: a part of their values is small, another of any size
SMALL: Mapping[str, tuple[str, ...]] = {
    "starts": ("1", "2"), "harmonics": ("1", "2", "3"), "intervals": ("6", "8", "15"), "order": ("4", "5", "6"),
    "period": ("1", "2", "0.5"), "rate": ("50", "100", "20"), "settle": ("0", "0.5"), "workers": ("1", "2"),
    "solver": ("sqp",), "speed": ("0.5", "1", "0.3"), "periods": ("1", "2"), "wrench_rate": ("50",),
    "repeat": ("0", "2", "3"), "repeats": ("0", "2"), "points": ("2", "5"), "warm_up": ("0", "1"),
    "breakaways": ("0", "1"), "creeping": ("1", "2"), "creep": ("10", "100", "50"), "ramping": ("1", "2"),
    "pause": ("0", "0.5"), "shortest": ("0.2", "0.3"), "longest": ("0.5", "1"), "stroke": ("0.5", "inf"),
    "percent": ("30,100", "50", "100"), "window_length": ("0.005", "0.02"), "velocity": ("1", "2,2", "0.5"),
    "acceleration": ("10", "5,10"), "jerk": ("200", "100,100"), "position": ("-1:1,-1:1", "-2:2,-2:2"),
}  # fmt: skip
ABSURD = ("0", "-1", "1e-300", "1e308", "nan", "inf", "1e20", "9" * 400, "9" * 5000, "", "1_0", "x", "true", "-0")
RIGHT: Mapping[str, tuple[str, ...]] = {
    "robot": ("two.yaml",), "task_file": ("task.yaml", "absurd.yaml"), "world": ("world.yaml",),
    "support": ("support.yaml",),
    "prior": ("prior.yaml", "0.2", "1e-9", "1e9"),
    "load": ("load.yaml", "1,0,0,0,1,0,0,1,0,1", "1e9,0,0,0,1e9,0,0,1e9,0,1e9", "1e-9,0,0,0,0,0,0,0,0,0"),
    "friction": ("friction.yaml",), "friction_curves": ("friction.yaml",), "parameters": ("r",), "plan": ("p",),
    "design_folder": ("d",), "designs": ("d",), "paths": ("d", "r", "d/design.json"), "robot_file": ("two.yaml",),
    "begin": ("d",), "impact": ("a:0.5:10", "b:1:1e9", "a:1:1:1e-6", "b:1:-1:1e5"),
    "drives": ("1", "2", "1,2", "z1", "none", "all"), "joints": ("1", "2", "1,2", "a"),
    "rows": ("auto", "all", "1:50", "10:12", "1:2"),
    "payload": ("1,0,0,0", "1e9,0,0,0", "1e-9,1e4,0,0", "load.yaml", "2,0,0,0.1,0.01,0,0,0.01,0,0.01"),
    "tool_box": ("-1:1,-1:1,-1:1", "-1e4:1e4,:,:", ":,:,:", "0.1:0.2,:,0:"), "loaded": ("other.csv",),
    "known_mass": ("1", "1e-9", "1e9"), "box": ("2", "1,2,1", "-2:2,-2:2,-2:2", "0.01", ":,:,:"),
    "pose": ("0,0", "0.1,-0.1", "3,3"), "centre": ("0.5,0,0", "0,0,0"), "swing": ("1", "0.5,1", "1e-6"),
    "frame": ("0,0,0.107", "0,0,0,1,1,1", "1e4,0,0"), "gains": ("gains.yaml",), "gain_deviation": ("0", "0.01", "1"),
    "without": ("bare.csv", "log.csv"), "wrench": ("held.wrench.csv",), "result": ("r",),
}  # fmt: skip
LEFT_OUT = {"help", "help_all", "set_options", "ways", "executor"}

ROBOT = """\
name: two
gravity: 9.81
joints:
  - {name: a, mdh: {}, limits: {position: [-2, 2], velocity: 2, acceleration: 10, jerk: 200, torque: 60}}
  - name: b
    mdh: {a: 0.5, alpha: 90 deg}
    limits: {position: [-2, 2], velocity: 2, acceleration: 10, jerk: 200, torque: 30}
links:
  - {name: A, mass: 4.0, com: [0.25, 0.0, 0.05], inertia: {about: centre-of-mass, xx: 0.02, yy: 0.1, zz: 0.1}}
  - {name: B, mass: 2.0, com: [0.2, 0.02, 0.0], inertia: {about: centre-of-mass, xx: 0.01, yy: 0.04, zz: 0.04}}
drives:
  - {name: z1, rotor_inertia: 0.02, ratio: 2.0, friction: {coulomb: 1.0, viscous: 0.5}}
  - {name: z2, rotor_inertia: 0.01, ratio: 2.0, friction: {coulomb: 0.5, viscous: 0.2}}
home: [0.1, -0.1]
"""
FILES = {
    "two.yaml": ROBOT,
    "world.yaml": "clearance: 0.01\nrobot: [{link: B, from: [0, 0, 0], to: [0.2, 0, 0], radius: 0.05}]\n"
    "objects: {wall: {plane: {normal: [0, 0, 1], offset: -2}}}\n",
    "support.yaml": "polygon: [[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]]\nstand: {mass: 9, centre: [0, 0, 0.1]}\n"
    "margin: 0.1\nfriction: 0.6\n",
    "prior.yaml": "F1c: {value: 1.0, deviation: 0.1}\n",
    "load.yaml": "m: 1.0\nmcx: 0.01\nIxx: 0.01\nIyy: 0.01\nIzz: 0.01\n",
    "friction.yaml": "schema: excite.friction/1\ndrives:\n  z1: {model: coulomb-viscous, coulomb: 1.0, viscous: 0.5}\n",
    "task.yaml": "seed: 1\nperiod: 2\nrate: 50\nharmonics: 2\nnoise: [1, 2]\nprior: 1\nsettle: 1\n"
    "limits: {velocity: [2, 1]}\ntool_box: [[-1, 1], [-1, 1], [-1, 1]]\ntool_speed: 2\n",
    "empty.yaml": "",
    "absurd.yaml": "period: 1e308\n",
}
DESIGN = (
    "design", "two.yaml", "--starts", "1", "--harmonics", "2", "--period", "2", "--rate", "50", "--executor", "serial",
)  # fmt: skip
MADE: tuple[tuple[str, ...], ...] = (
    (*DESIGN, "--out", "d"),
    ("simulate", "d", "--out", "log.csv", "--rate", "100", "--torque-noise", "0.05"),
    ("simulate", "d", "--out", "other.csv", "--rate", "100", "--torque-noise", "0.05", "--seed", "1"),
    ("identify", "two.yaml", "log.csv", "--design", "d", "--choose", "none", "--out", "r"),
    (
        "friction", "plan", "two.yaml", "--drives", "1", "--speeds", "30,100", "--warm-up", "0", "--rate", "100",
        "--breakaways", "0", "--out", "p",
    ),
    ("simulate", "p/z1.csv", "--out", "z1.csv", "--rate", "100", "--controller", "pd"),
    ("payload", "design", "panda", "--harmonics", "2", "--period", "2", "--rate", "50", "--out", "pd",
     "--no-self-collision", "--floor", "none"),
    ("simulate", "pd", "--out", "bare.csv", "--rate", "100", "--torque-noise", "0.05"),
    ("simulate", "pd", "--out", "held.csv", "--rate", "100", "--torque-noise", "0.05", "--load", "load.yaml"),
    ("payload", "gains", "panda", "--without", "bare.csv", "--with", "held.csv", "--mass", "1", "--out", "gains.yaml"),
)  # fmt: skip
# the beginning of every command line: within the budget, and right
BASE: Mapping[str, tuple[str, ...]] = {
    "design": (*DESIGN, "--out", "o"),
    "simulate": ("simulate", "d", "--rate", "50", "--wrench-rate", "50", "--out", "o/log.csv"),
    "identify": ("identify", "two.yaml", "log.csv", "--choose", "none", "--out", "o"),
    "verify": ("verify", "r", "other.csv", "--out", "o"),
    "study": ("study", "two.yaml", "log.csv", "--points", "3", "--rate", "50", "--out", "o"),
    "plan": ("plan", "two.yaml"),
    "compare": ("compare", "d"),
    "robots": ("robots", "two.yaml"),
    "export": ("export", "d", "--format", "npz", "--rate", "50", "--out", "o/motion.npz"),
    "logs": ("logs", "log.csv", "--write-mapping", "o/map.yaml"),
    "report": ("report", "d", "--out", "o/page.html"),
    "friction plan": (
        "friction", "plan", "two.yaml", "--drives", "1", "--speeds", "100", "--warm-up", "0", "--rate", "100",
        "--breakaways", "0", "--out", "o",
    ),
    "payload design": (
        "payload", "design", "two.yaml", "--box", "2", "--harmonics", "2", "--period", "2", "--rate", "50",
        "--out", "o",
    ),
    "payload gains": (
        "payload", "gains", "panda", "--without", "bare.csv", "--with", "held.csv", "--mass", "1", "--out", "o/g.yaml",
    ),
    "payload identify": (
        "payload", "identify", "panda", "--without", "bare.csv", "--with", "held.csv", "--out", "o",
    ),
    "friction fit": ("friction", "fit", "two.yaml", "z1.csv", "--plan", "p", "--drives", "z1", "--out", "o"),
}  # fmt: skip


# commands that read a file whose numbers are changed
READ: Mapping[str, tuple[str, ...]] = {
    "two.yaml": BASE["design"],
    "world.yaml": (*BASE["design"], "--world", "world.yaml"),
    "support.yaml": (*BASE["design"], "--support", "support.yaml"),
    "prior.yaml": (*BASE["design"], "--prior", "prior.yaml"),
    "task.yaml": (*DESIGN[:2], "--task", "task.yaml", "--starts", "1", "--executor", "serial", "--out", "o"),
    "load.yaml": (*BASE["simulate"], "--load", "load.yaml"),
    "friction.yaml": (*BASE["simulate"], "--friction", "friction.yaml"),
}


def option_words(option: click.Option) -> st.SearchStrategy[list[str]]:
    """Words on the command line for one option of a command."""
    flag = option.opts[-1] if len(option.opts[-1]) > 2 else option.opts[0]
    if option.is_flag:
        return st.sampled_from([flag, *option.secondary_opts]).map(lambda word: [word])
    return _values(option).map(lambda value: [f"{flag}={value}"] if flag.startswith("--") else [flag, value])


def _values(option: click.Option) -> st.SearchStrategy[str]:
    """Text of a value: three times of four one that the option may have, as far as it is known what that is."""
    name, kind = str(option.name), option.type
    quantity = (kind.quantity or name if isinstance(kind, Number | Numbers) else name).removesuffix("_limit")
    if quantity in SMALL:
        small, absurd = st.sampled_from(SMALL[quantity]), st.sampled_from(ABSURD)
        size = _of_any_size(kind, quantity)
        return st.one_of(small, size, size, absurd)
    if isinstance(kind, click.Choice):
        return _mostly(st.sampled_from(list(kind.choices)), st.sampled_from(NASTY[-6:]))
    if name in RIGHT:
        return _mostly(
            st.sampled_from(RIGHT[name]), st.sampled_from([*FILES, "d", "r", "p", "log.csv", *NAMES, *NASTY])
        )
    if isinstance(kind, PartName):
        return _mostly(st.sampled_from([*kind.names, "mine:Mine"]), st.sampled_from(NAMES))
    if isinstance(kind, click.Path | Folder):
        return st.sampled_from([*FILES, "d", "r", "p", "log.csv", "z1.csv", "other.csv", "missing", "", "\u00e9", "o"])
    if quantity not in QUANTITIES:
        return _mostly(st.sampled_from(NAMES), st.sampled_from(NASTY))
    return _numbers(kind, sizes(QUANTITIES[quantity]))


def _of_any_size(kind: click.ParamType[Any], quantity: str) -> st.SearchStrategy[str]:
    inside = sizes(QUANTITIES[quantity]) if quantity in QUANTITIES else SMALL[quantity]
    middle = ["5", "20", "33", "200", "900", "1000", "3000", "30000", "200000"]
    held = [text for text in middle if quantity in QUANTITIES and QUANTITIES[quantity].holds(int(text))]
    return _numbers(kind, [*inside, *held, *held, *held])


def _mostly(right: st.SearchStrategy[str], other: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.one_of(right, right, right, other)


def sizes(quantity: Quantity) -> list[str]:
    """Numbers over the whole range of a quantity, both ends among them."""
    powers = [f"{sign}1e{k}" for sign in ("", "-") for k in range(-12, 13)]
    texts = [*powers, "0", "0.5", "2", "3", "10", "1", repr(quantity.least), repr(quantity.most)]
    if quantity.whole:
        texts = [str(int(float(text))) for text in texts if float(text).is_integer() and "." not in text]
    return sorted({text for text in texts if quantity.holds(int(text) if quantity.whole else float(text))})


def _numbers(kind: click.ParamType[Any], inside: list[str]) -> st.SearchStrategy[str]:
    one = st.sampled_from(inside)
    sides, counted = isinstance(kind, Sides), isinstance(kind, Numbers) and kind.counts
    count = 4 if kind is PAYLOAD else 3 if counted or (sides and kind.box) else 2
    each = st.tuples(one, one).map(":".join) if sides else one
    right = st.lists(each, min_size=count, max_size=count).map(",".join)
    if isinstance(kind, Numbers) and not counted and not kind.words:
        right = st.one_of(one, right)
    elif not sides and not isinstance(kind, Numbers) and kind is not PAYLOAD:
        right = one
    several = st.lists(st.sampled_from([*JOINED, *inside]), min_size=1, max_size=5).map(",".join)
    return _mostly(right, st.one_of(st.sampled_from(NASTY), several, st.sampled_from(sorted(FILES))))


def command_lines(name: str) -> st.SearchStrategy[list[str]]:
    """Command lines of one command: a right one, and up to four options with any value."""
    options = [p for p in COMMANDS[name].params if isinstance(p, click.Option) and p.name not in LEFT_OUT]
    chosen = st.lists(st.sampled_from(options), min_size=1, max_size=4, unique_by=lambda option: option.name)
    drawn = chosen.flatmap(lambda some: st.tuples(*map(option_words, some)))
    return drawn.map(lambda words: [*BASE[name], *(word for some in words for word in some)])


def file_cases() -> st.SearchStrategy[tuple[list[str], dict[str, str]]]:
    """Command lines with a file in which one or two numbers are any others, and the text of that file."""
    drawn = st.tuples(st.sampled_from(sorted(READ)), st.lists(st.tuples(st.integers(0, 99), _any_number()), max_size=2))
    return drawn.map(lambda case: (list(READ[case[0]]), {case[0]: _changed(FILES[case[0]], case[1])}))


def _any_number() -> st.SearchStrategy[str]:
    powers = [f"{sign}1e{k}" for sign in ("", "-") for k in range(-12, 13, 2)]
    return st.one_of(st.sampled_from(powers), st.sampled_from(powers), st.sampled_from([*NASTY, "[]", "{}", "null"]))


def _changed(text: str, changes: Sequence[tuple[int, str]]) -> str:
    """A text whose numbers are replaced by their place, counted around."""
    for place, value in changes:
        numbers = list(re.finditer(r"(?<![\w/.-])-?\d+(\.\d+)?(?![\w.])", text))
        if numbers:
            found = numbers[place % len(numbers)]
            text = text[: found.start()] + value + text[found.end() :]
    return text


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    Parameters
    ----------
    problems : tuple of str
        What must not be; empty if all is well.
    status : int
    errors : str
        What it wrote to stderr.
    growth : float
        Of the memory, from before to its largest [MB].
    pressed : bool
        Whether Ctrl-C was pressed, because it took long.
    """

    problems: tuple[str, ...]
    status: int
    errors: str
    growth: float
    pressed: bool


class TooLong(BaseException):
    """The command took longer than a case may."""


def prepare(folder: Path) -> None:
    """Make the files that commands read: a robot, a design, logs, a result, a friction plan."""
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")
    for arguments in MADE:
        ended = run(arguments, folder, clean=False, patience=60.0)
        assert ended.status in (0, 1), (arguments, ended)
    shutil.copytree(folder, _copy_of(folder))


def run(
    arguments: Sequence[str],
    folder: Path,
    *,
    files: Mapping[str, str] | None = None,
    clean: bool = True,
    patience: float = PATIENCE,
) -> Ended:
    """Run a command in this process, in a folder that `prepare` filled, and judge how it ends.

    Some of its files may have other texts meanwhile. Where it is still at work after `patience` seconds of processor
    time, it gets one Ctrl-C.
    """
    for name, text in (files or {}).items():
        (folder / name).write_text(text, encoding="utf-8")
    try:
        return _ended(arguments, folder, clean=clean, patience=patience)
    finally:
        for name in files or {}:
            (folder / name).write_text(FILES[name], encoding="utf-8")
        if clean:
            _restore(folder)


def _copy_of(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.as-made")


def _restore(folder: Path) -> None:
    """Put back what a command has replaced, such as ``--out two.yaml --force``: cases begin with the same files."""
    made = _copy_of(folder)
    for path in made.rglob("*"):
        now = folder / path.relative_to(made)
        if path.is_file() and not (now.is_file() and _mark(now) == _mark(path)):
            shutil.rmtree(folder)
            shutil.copytree(made, folder)
            return


def _mark(path: Path) -> tuple[int, int]:
    state = path.stat()
    return state.st_size, state.st_mtime_ns


def _ended(arguments: Sequence[str], folder: Path, *, clean: bool, patience: float) -> Ended:
    out, err, problems = io.StringIO(), io.StringIO(), list[str]()
    before = {path.name for path in folder.iterdir()}
    status, pressed = 2, list[str]()
    here, held = os.getcwd(), _memory_from_here()
    os.chdir(folder)
    try:
        with (
            warnings.catch_warnings(record=True) as leaked,
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            patch.object(sys, "argv", ["excite", *arguments]),
            _alarm(patience, pressed),
        ):
            warnings.simplefilter("always")
            warnings.filterwarnings("ignore", category=DeprecationWarning)
            # Ctrl-C may fall between a library's `open` and its `with`
            warnings.filterwarnings("ignore", r"unclosed file .*/proc/self/maps", ResourceWarning)
            main()
    except SystemExit as ended:
        status = ended.code if isinstance(ended.code, int) else 2
    except TooLong:
        problems.append(f"takes longer than {SECONDS:g} s to end after Ctrl-C")
    except BaseException as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        problems.append(f"{type(error).__name__}: {str(error)[:200]} ({Path(place.filename).name}:{place.lineno})")
    finally:
        os.chdir(here)
    problems += [f"warning: {str(one.message)[:100]} ({Path(one.filename).name}:{one.lineno})" for one in leaked]
    growth = memory() - held
    if growth > 1e3 * CAP:
        problems.append(f"takes {round(growth, -2):.0f} MB")
    if not (pressed and status == 128 + signal.SIGINT):
        told = bool(pressed) or any(option in arguments for option in ("-v", "--verbose"))
        problems += _wrong_output(status, out.getvalue(), err.getvalue(), progress=told)
    if clean:
        problems += _not_finite(folder / "o")
        _clear(folder, before)
    return Ended(tuple(dict.fromkeys(problems)), status, err.getvalue(), growth, bool(pressed))


@contextlib.contextmanager
def _alarm(patience: float, pressed: list[str]) -> Iterator[None]:
    """Press Ctrl-C after `patience`, and end the command if it has not done so some time later.

    Times are of the processor, or ten times as much on the clock, as on a busy machine.
    """

    def ring(number: int, _: FrameType | None) -> None:
        if pressed:
            raise TooLong
        pressed.append("Ctrl-C")
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.setitimer(signal.ITIMER_REAL, 10 * SECONDS)
        signal.raise_signal(signal.SIGINT)

    clocks = ((signal.SIGPROF, signal.ITIMER_PROF, patience), (signal.SIGALRM, signal.ITIMER_REAL, 10 * patience))
    before = [(number, signal.signal(number, ring)) for number, _, _ in clocks]
    hook = sys.unraisablehook  # Ctrl-C that a callback of the collector has lost is raised again
    sys.unraisablehook = lambda lost: None if issubclass(lost.exc_type, KeyboardInterrupt) else hook(lost)
    for _, clock, limit in clocks:
        signal.setitimer(clock, limit)
    try:
        yield
    finally:
        for _, clock, _ in clocks:
            signal.setitimer(clock, 0)
        sys.unraisablehook = hook
        for number, handler in before:
            signal.signal(number, handler)


def _wrong_output(status: int, out: str, err: str, *, progress: bool) -> Iterator[str]:
    if status not in STATUSES:
        yield f"exit status {status}"
    lines = err.splitlines() or [""]
    few = progress or len(lines) <= LINES
    if status == 2 and not (lines[-1].startswith("excite: ") and few and len(lines[-1]) <= LONGEST):
        yield f"exit status 2 with {len(lines)} lines, of {len(lines[-1])} characters the last one"
    if "Traceback" in err or "Warning" in err:
        yield "a traceback or a warning on stderr"
    if "\x1b" in err or "\x1b" in out:
        yield "an escape sequence in the output"


def _not_finite(folder: Path) -> Iterator[str]:
    """Files with a number that is not finite."""
    for path in sorted(folder.rglob("*")) if folder.is_dir() else []:
        if path.suffix in (".csv", ".json", ".yaml") and path.is_file():
            text = path.read_text(encoding="utf-8")
            body = re.sub(r'"(?:[^"\\]|\\.)*"', '""', text) if path.suffix == ".json" else text
            if found := NOT_FINITE.search(body):
                yield f"{path.name} holds {found[0]}"


def _clear(folder: Path, before: set[str]) -> None:
    for path in folder.iterdir():
        if path.name not in before:
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def memory() -> float:
    """Largest memory of this process [MB], since `_memory_from_here` where the system can tell."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _memory_from_here() -> float:
    """Forget the largest memory so far, on Linux, and return that of now [MB]."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    return memory()


@contextlib.contextmanager
def without_figures() -> Iterator[None]:
    """Nothing is rendered: figures are made, but their files stay empty, and their texts are not looked at."""
    savefig = patch("matplotlib.figure.Figure.savefig", lambda self, stream, **_: None)
    in_pages = patch("excite.views.page_text.svg_text", lambda *_: "<svg></svg>")
    with savefig, in_pages, patch("excite.views.figures.literal", lambda figure: None):
        yield


@contextlib.contextmanager
def prepared() -> Iterator[Path]:
    """A temporary folder with the files that commands read."""
    capped = patch.dict(os.environ, {CAP_VARIABLE: f"{CAP}"})
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name, without_figures(), capped:
        folder = Path(name) / "cases"
        folder.mkdir()
        prepare(folder)
        yield folder
