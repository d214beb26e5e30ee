"""Edits in place: what is changed reads back, and all other bytes stay."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from excite.export.models.xml_copy import XmlDocument, comment
from regressors.errors import InputError

TEXT = st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Cn")), max_size=12)
SPACE = st.text(" \t\n", min_size=1, max_size=3)


@given(st.lists(TEXT, min_size=2, max_size=2), TEXT, st.lists(SPACE, min_size=4, max_size=4), st.booleans())
@settings(deadline=None, max_examples=100)
def test_an_attribute_is_set_and_nothing_else(old: list[str], new: str, space: list[str], bom: bool) -> None:
    before = f"<?xml version='1.0'?><!--{'x'}--><a>{space[0]}<b{space[1]}p={quoteattr(old[0])}{space[2]}q{space[3]}="
    after = f"{quoteattr(old[1])}/>é</a>"
    content = (("\ufeff" if bom else "") + before + after).encode()
    document = XmlDocument(content, "text")
    (element,) = document.root.below("b")
    document.set(element, {"q": new})
    edited = document.edited()
    assert edited.startswith(("\ufeff" if bom else "").encode() + before.encode())
    assert edited.endswith("/>é</a>".encode())
    read = ET.fromstring(edited).find("b")
    assert read is not None
    assert read.get("q") == ET.fromstring(f"<b q={quoteattr(new)}/>").get("q")
    assert read.get("p") == ET.fromstring(f"<b q={quoteattr(old[0])}/>").get("q")


CASES = (
    ("<a/>", "<a>\n  <n/>\n</a>"),
    ("<a></a>", "<a>\n  <n/>\n</a>"),
    ("<a>\n</a>", "<a>\n  <n/>\n</a>"),
    ("<a>\n\t<b/>\n</a>", "<a>\n\t<b/>\n\t<n/>\n</a>"),
    ("<a><b/></a>", "<a><b/>\n<n/></a>"),
    ("<a>\r\n <b></b><!-- c -->\r\n</a>", "<a>\r\n <b></b>\r\n <n/><!-- c -->\r\n</a>"),
)


@pytest.mark.parametrize(("before", "after"), CASES)
def test_an_element_is_inserted_as_its_siblings_are(before: str, after: str) -> None:
    document = XmlDocument(before.encode(), "text")
    document.insert_in(document.root, "<n/>")
    assert document.edited().decode() == after
    assert ET.fromstring(after).find("n") is not None


def test_several_edits_do_not_disturb_each_other() -> None:
    document = XmlDocument(b"<a x='1'><b y='2'/><b/></a>", "text")
    first, second = document.root.below("b")
    document.set(document.root, {"x": "10", "w": "3"})
    document.set(first, {"y": "2"})  # as it is
    document.insert_in(second, "<c/>")
    document.insert_before(document.root, "<!-- n -->")
    document.replace_tag(first, "<d/>")
    assert document.edited() == b"<!-- n -->\n<a x='10' w=\"3\"><d/><b>\n  <c/>\n</b></a>"


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"<a>", "line 1: not well-formed"),
        ("<a/>".encode("utf-16"), "UTF-16"),
        (b"", "not well-formed"),
        (b"<!DOCTYPE a><a/>", "DOCTYPE"),
    ],
)
def test_what_is_no_document_is_refused(content: bytes, says: str) -> None:
    with pytest.raises(InputError, match=says):
        XmlDocument(content, "text")


@given(st.lists(TEXT))
def test_comments_hold_any_line(lines: list[str]) -> None:
    ET.fromstring(f"{comment([*lines, '--', '---->', '-'])}<a/>")
