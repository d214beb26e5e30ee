"""The ``excite`` command: runs the requested command, and turns errors into one line and an exit status."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

import click

from excite.cli.lazy import LazyGroup
from excite.cli.streams import (
    be_quiet,
    discard_unwritten,
    in_options,
    open_streams,
    printed_warnings,
    say,
    sign_of_life,
)
from excite.design.interruption import answered_signals, repeat_lost_signal
from excite.operating_system import THREADS
from regressors.errors import ExciteError, InputError, NumericalError, one_line

_COMMANDS = {
    "robots": "List built-in robots, or show one: joints, limits, base parameters.",
    "design": "Find the motion that identifies a robot's parameters best, and write it.",
    "plan": "Propose the shortest campaign of partial motions that identifies every parameter.",
    "sweep": "Design for every combination of options that a sweep file states.",
    "export": "Write a design as a motion that a controller plays, or a result as a model.",
    "simulate": "Simulate the motion of a design, and write what the robot would measure.",
    "logs": "Show what a recording holds, and write the mapping that reads it.",
    "predict": "Predict how much parameters will scatter from repeat to repeat, under stated noise.",
    "identify": "Estimate a robot's parameters from its logs, with their uncertainty.",
    "verify": "Judge a result on a log that was not used to identify.",
    "study": "Follow estimates over the growing time of logs and simulated designs.",
    "friction": "Plan runs that measure friction, and fit friction curves to their logs.",
    "payload": "Measure what a robot holds: design the motion, calibrate gains, identify.",
    "report": "Write one HTML page on designs, identifications and verifications, with a 3D player.",
    "compare": "Compare candidate designs by the same metrics.",
    "bound": "Bound the criteria of all motions within the limits: how far a design is from the best possible.",
}
_GROUPS = {
    "Design a motion": ("robots", "design", "plan", "sweep", "compare", "bound", "predict", "export"),
    "From logs to parameters": ("simulate", "logs", "identify", "verify", "study"),
    "Friction and payload": ("friction", "payload"),
    "Share results": ("report",),
}
_FILES = {
    "design_commands": ("design", "plan", "compare", "bound"),
    "exchange_commands": ("robots", "logs", "export", "report"),
    "identify_commands": ("identify", "verify"),
    "study_commands": ("simulate", "predict", "study"),
}
BAD_INPUT, NOT_HELD = 2, 1
_OBJECTS = 1_000_000  # before the collector looks for cycles: imports and figures make many objects and few cycles


@click.group(
    cls=LazyGroup,
    summaries=_COMMANDS,
    groups=_GROUPS,
    places={name: f"{file}:{name}" for file, names in _FILES.items() for name in names},
    epilog="""\b
Start with:
  excite robots                          which robots are built in
  excite robots irp6                     one robot's joints, limits and base parameters
  excite design irp6 --out designs/irp6  design a motion; writes CSV, JSON and figures
  excite compare designs/*               which candidate is best, under every convention
  excite simulate designs/irp6 --out run.csv                          what the robot would measure
  excite identify irp6 run.csv --design designs/irp6 --out results    its parameters, with their uncertainty
  excite verify results other.csv                                     whether they predict another log
  excite export results --format urdf --out irp6.urdf                 the identified model for simulators
  excite report designs/irp6 results --out irp6.html                  one page to read, with the motion in 3D

\b
Exit status: 0 done; 1 done, but the result does not meet what was asked;
2 bad input, or numbers that cannot be computed with, one line on stderr;
130 interrupted, the best so far saved (143 by SIGTERM, 129 by SIGHUP).""",
)
@click.version_option(
    package_name="excite-trajectories", prog_name="excite", message="%(prog)s %(version)s", help="Show the version."
)
def cli() -> None:
    """Design motions that make a robot's dynamic parameters identifiable, within every limit of the robot."""


cli.add_command(
    LazyGroup(
        name="friction",
        summaries={
            "plan": "Plan runs at constant speed, from which friction is measured.",
            "fit": "Fit friction curves to logs of runs at constant speed.",
        },
        places={"plan": "friction_commands:plan", "fit": "friction_commands:fit"},
        help="""Measure a robot's friction on its own: plan the runs, fit the curves.

    The curves are saved as a file that --friction-curves of 'excite design' and 'excite identify' takes, and
    --friction of 'excite simulate'.""",
    )
)
cli.add_command(
    LazyGroup(
        name="payload",
        summaries={
            "design": "Find a short motion in a small box that shows what the robot holds.",
            "gains": "Calibrate the gains of the drives with a load of known mass.",
            "identify": "Estimate mass, centre and inertia of what the robot holds.",
        },
        places={name: f"payload_commands:{name}" for name in ("design", "gains", "identify")},
        help="Measure what a robot holds: mass, centre and inertia, in seconds, by its own joint torques or a wrist "
        "sensor.",
        epilog="""\b
From an unknown gripper to the numbers of the controller:
  excite payload design ur10e --box 0.2 --period 5 --out motion       the motion; play it without and with the load
  excite payload gains ur10e --without bare.csv --with weight.csv --mass 2.5 --out gains.yaml        once, optional
  excite payload identify ur10e --without bare.csv --with load.csv --gains gains.yaml --out payload  mass, ...""",
    )
)
cli.add_command(
    LazyGroup(
        name="sweep",
        summaries={"run": "Design every cell of a sweep file, or those that are left, and tabulate all."},
        places={"run": "design_commands:run"},
        help="""Design for every combination of robots, models, families, criteria, limits and seeds that a file states.

    'excite plan' is another thing: it proposes which drives to move in which motion.""",
    )
)


def _fail(message: str, status: int) -> NoReturn:
    say(f"excite: {one_line(in_options(message))}")
    sys.exit(status)


@contextmanager
def _errors_of_compiled_code() -> Iterator[None]:
    """What numerical libraries raise is one error, what they make of a signal, such as a SystemError, is the signal."""
    try:
        yield
    except Exception as error:
        repeat_lost_signal()
        if not isinstance(error, ArithmeticError | RuntimeError | RuntimeWarning | ValueError):
            raise
        from regressors.numerical import numerical_work  # imports NumPy

        with numerical_work("this command", "values of very different sizes are the likely cause: check those given"):
            raise


def main() -> None:
    """Run the command line and end the process with its exit status."""
    gc.set_threshold(_OBJECTS, 50, 100)
    for variable in THREADS:  # of linear algebra: on matrices as small as ours more threads only wait for each other
        os.environ.setdefault(variable, "1")
    atexit.register(gc.freeze)  # what is left at the end goes with the process: no search for cycles among it
    open_streams()
    atexit.register(discard_unwritten)
    with answered_signals() as interruption, printed_warnings():
        interruption.before_leaving = be_quiet  # the step at work is shown by another thread
        try:
            _run()
        except (click.Abort, KeyboardInterrupt):
            _fail("interrupted before any result", interruption.status)


def _run() -> NoReturn:
    try:
        with sign_of_life(), _errors_of_compiled_code():
            status = cli.main(standalone_mode=False) or 0
        sys.exit(status)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        sys.exit(0)
    except click.UsageError as error:
        hint = f"; see '{error.ctx.command_path} --help'" if error.ctx is not None else ""
        _fail(error.format_message().rstrip(".") + hint, BAD_INPUT)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the pipe is closed: discard further output
        sys.exit(NOT_HELD)
    except (click.ClickException, InputError, NumericalError) as error:
        _fail(str(error), BAD_INPUT)
    except ExciteError as error:
        _fail(str(error), NOT_HELD)
    except MemoryError:
        _fail("not enough memory for this task: take a lower rate, a shorter period or fewer harmonics", BAD_INPUT)
    except OSError as error:
        _fail(f"{error.filename or 'file'}: {error.strerror or error}", BAD_INPUT)
