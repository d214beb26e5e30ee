"""Colours of units: one for each, whatever the robot."""

from __future__ import annotations

import itertools

from excite.information.target import target_of
from excite.plots.unit_colours import unit_patches, unit_style
from excite.tasks.task import Task
from regressors.models.drives import _DRIVE_COLUMNS
from regressors.readers.library import load_robot
from regressors.robot.inertia import PARAMETER_UNITS

BUILT_IN = {*PARAMETER_UNITS, *(unit for _, *units in _DRIVE_COLUMNS.values() for unit in units), "Nm/rad", "N/m"}


def look(unit: str) -> tuple[object, object]:
    style = unit_style(unit)
    return style["facecolor"], style["hatch"]


def test_every_unit_of_a_built_in_model_has_a_look_of_its_own() -> None:
    assert all(look(a) != look(b) for a, b in itertools.combinations(sorted(BUILT_IN), 2))
    assert look("furlong") not in {look(unit) for unit in BUILT_IN}


def test_a_unit_looks_the_same_on_every_robot() -> None:
    legends = []
    for name in ("irp6", "panda", "ur10e"):
        units = target_of(load_robot(name), Task(name)).base.units
        legends.append({p.get_label(): (p.get_facecolor(), p.get_hatch()) for p in unit_patches(units)})
    for first, second in itertools.combinations(legends, 2):
        assert set(first) & set(second)
        assert all(first[unit] == second[unit] for unit in set(first) & set(second))


def test_units_of_own_models_share_one_entry() -> None:
    assert [patch.get_label() for patch in unit_patches(["W", "kg m", "cd", "kg m"])] == ["kg m", "W, cd"]
