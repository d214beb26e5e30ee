"""``excite sweep``: designs for every combination of options that a file states."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from excite.cli.command import Command
from excite.cli.option_types import Folder
from excite.cli.options import executor_options, figure_options


@click.command(
    "run",
    cls=Command,
    groups={"Execution": ("executor", "workers")},
    epilog="""\b
Examples:
  excite sweep run sweep.yaml --out sweeps/arms
  excite sweep run sweep.yaml --out sweeps/arms --report --figures svg
  excite sweep run sweep.yaml --out sweeps/arms --executor dask://10.0.0.1:8786

\b
Contents of FILE (YAML; options are the keys of a task file, see --task of 'excite design'):
  common: {starts: 4, harmonics: 5}                  options of every cell
  grid:                                              every combination of these is a cell
    robot: [irp6, panda]
    trajectory: [fourier, cosine]
    limits: {slow: {velocity: 0.5}, fast: {velocity: 1.0}}    labels of long values
    seed: [0, 1, 2]
  exclude: [{robot: panda, limits: slow}]            combinations that are left out
  include: [{robot: ur10e, limits: {acceleration: 3}}]        further cells

\b
What is written to DIR:
  cells/NAME     of every cell, such as robot=irp6,seed=0, an ordinary folder of a design
  campaign.csv   one line per cell: options, status, every criterion, tightest limit, time; campaign.json likewise
  campaign.png   the condition numbers by each option
  campaign.html  with --report

\b
Cells run on all cores, each with its starts one after the other. The same command again continues where it stopped.
Exit status: 0 every cell has a design within its limits; 1 at least one has not, and the table says why.""",
)
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=Folder(), metavar="DIR", help="Folder to write.")
@executor_options("Where the cells run.", "Number of processes.  [default: one per core]")
@figure_options()
@click.option("--report", is_flag=True, help="Write campaign.html too: table and figure as one page.")
@click.option("--force", is_flag=True, help="Replace cells of the same names that have other options.")
def run(file: Path, out: Path, **given: Any) -> None:
    """Design every cell of the sweep FILE, or those that are left, and write all of them in one table."""
    from excite.cli.sweep_run import run_and_write

    run_and_write(file, out, **given)
