"""The view of a verification: terminal, page and file say the same."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from reported import ParsedPage
from written_results import verification

from excite.cli.view_text import brief_table, print_verdict, print_view
from excite.verification.verification import MeasuredMotion
from excite.views.verification_view import verification_view
from excite.views.view import Format
from excite.views.write_report import report_text


def test_every_number_of_the_tables_is_on_the_page() -> None:
    v = verification("old")
    page = ParsedPage(report_text(v))
    for table in verification_view(v).tables:
        numbers = [k for k, column in enumerate(table.columns) if column.format in (Format.NUMBER, Format.PERCENT)]
        expected = [[row[k] for k in numbers if row[k] is not None and math.isfinite(row[k])] for row in table.rows]
        assert page.numbers(table.name) == expected


def test_the_terminal_has_the_same_tables(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    view = verification_view(verification("old"))
    print_verdict(view)
    print_view(view)
    printed = capsys.readouterr().out
    assert view.verdict in printed
    for table in view.tables:
        assert table.title in printed
        for row in table.rows:
            assert str(row[0]) in printed
    torques = view.tables[0]
    assert f"{100 * torques.rows[0][4]:.3g} %" in printed


def test_the_summary_has_the_brief_columns_with_units() -> None:
    (table,) = brief_table(verification_view(verification("old")).tables[0])
    assert not isinstance(table, str)
    assert [column.header for column in table.columns] == [
        "equation",
        "torque error",
        "of measured",
        "simulated motion",
    ]
    assert next(iter(table.columns[1].cells)).endswith(" Nm")


def test_without_curves_nothing_is_drawn() -> None:
    v = verification("old")
    without = dataclasses.replace(v, time=np.zeros(0), motion=MeasuredMotion(), replay=None)
    assert verification_view(without).figures == ()
    assert len(verification_view(v).figures) == 3
