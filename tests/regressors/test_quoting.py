"""Text of others in messages: nothing a terminal would obey, nothing long."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from regressors.errors import LONGEST, LONGEST_LINE, UnknownName, cut, listed_names, one_line, printable, shortened


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("q1", "q1"),
        ("\x1b[31mred", r"\x1b[31mred"),
        ("a\x9bb", r"a\x9bb"),
        ("\u202eabc", r"\u202eabc"),
        ("caf\xe9 \u03bc", "caf\xe9 \u03bc"),
        ("\udcff", r"\udcff"),
    ],
)
def test_what_a_terminal_would_obey_is_shown(text: str, shown: str) -> None:
    assert printable(text) == shown


@given(st.text(max_size=3000))
def test_nothing_is_long_or_obeyed(text: str) -> None:
    for shown, most in ((cut(text), LONGEST), (shortened(text), LONGEST), (one_line(text), LONGEST_LINE)):
        assert len(shown) <= most
        assert shown.isprintable()


def test_both_ends_of_a_long_text_are_kept() -> None:
    assert cut("a" + 5000 * "b" + "c").startswith("abb")
    assert cut("a" + 5000 * "b" + "c").endswith("...bbbbc")
    assert one_line("what " + 400 * "is wrong " + "and the remedy").endswith(" and the remedy")


def test_a_number_that_python_refuses_to_print() -> None:
    assert shortened(10**5000) == "a very long number"


def test_of_many_names_the_last_are_counted() -> None:
    assert listed_names(str(k) for k in range(60_000)).endswith("29 and 59970 more")
    error = str(UnknownName("joint", 5000 * "x", (f"{k}\x1b" for k in range(60_000))))
    assert len(error) < 400
    assert error.isprintable()
