"""Views of friction plans and campaigns: terminal and page say the same."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from reported import ParsedPage
from written_results import plan

import excite
from excite.cli.view_text import print_verdict, print_view
from excite.design.sweeps.sweep_table import BROKEN, DESIGNED, CellFacts, SweepRow, SweepTable
from excite.views.campaign_view import campaign_view, cells_view, leading_cells
from excite.views.friction_plan_view import friction_plan_view
from excite.views.view import Format, View
from excite.views.write_report import report_text

FACTS = CellFacts(
    robot="irp6", model="differential", parameters=13, duration=2.0, criterion=3.0, limit_use=0.5,
    tightest_limit="joint q1 velocity",
)  # fmt: skip
ROWS = (
    SweepRow("a", {"seed": "0"}, DESIGNED, 1, {"condition_number": 7.0}, FACTS),
    SweepRow("b", {"seed": "1"}, BROKEN, 1, {"condition_number": 5.0}, replace(FACTS, limit_use=1.5)),
    SweepRow("c", {"seed": "2"}, "infeasible", reason="no motion"),
)
SUBJECTS = {
    "friction plan": (lambda: plan("old"), friction_plan_view),
    "cells": (lambda: SweepTable(ROWS), cells_view),
    "campaign": (lambda: excite.plan_campaign("irp6"), campaign_view),
}


def subject(name: str) -> tuple[Any, View]:
    make, view = SUBJECTS[name]
    made = make()
    return made, view(made)


@pytest.mark.parametrize("name", SUBJECTS)
def test_every_number_of_the_tables_is_on_the_page(name: str) -> None:
    made, view = subject(name)
    page = ParsedPage(report_text(made))
    for table in view.tables:
        numbers = [k for k, each in enumerate(table.columns) if each.format not in (Format.TEXT, Format.UNIT)]
        expected = [[row[k] for k in numbers if row[k] is not None and math.isfinite(row[k])] for row in table.rows]
        assert page.numbers(table.name) == expected, table.name


@pytest.mark.parametrize("name", SUBJECTS)
def test_the_terminal_has_the_same_tables(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "250")
    view = subject(name)[1]
    print_verdict(view)
    print_view(view)
    printed = capsys.readouterr().out
    assert view.verdict in printed
    for table in (each for each in view.tables if not each.folded):
        assert table.title in printed
        for row in table.rows:
            assert str(row[0]) in printed


def test_a_summary_of_cells_begins_with_the_best() -> None:
    leading = leading_cells(SweepTable(ROWS)).brief
    assert [column.heading for column in leading.columns][:3] == ["seed", "status", "group"]
    assert [row[:4] for row in leading.rows] == [("1", BROKEN, 1, 5.0), ("0", DESIGNED, 1, 7.0)]


def test_a_plan_that_breaks_limits_does_not_hold() -> None:
    made = plan("old")
    (c,) = made.coordinates
    use = replace(c.limits[0], margin=-1.0)
    broken = friction_plan_view(replace(made, coordinates=(replace(c, limits=(use, *c.limits[1:])),)))
    assert not broken.holds
    assert f"It breaks 1 limit: {use.label}." in broken.verdict
    assert any(f"{use.label} does not hold" in remark for remark in broken.remarks)
