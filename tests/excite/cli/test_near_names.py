"""A name that is typed wrongly is answered with the one that may be meant."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import Here

from excite import load_robot
from regressors.errors import InputError, UnknownName
from regressors.readers.library import built_in

CASES = {
    "desing irp6": "did you mean design?",
    "friction plam irp6": "did you mean plan?",
    "payload gain ur10e": "did you mean gains?",
    "design irp7 --out o": "did you mean 'irp6'?",
    "friction plan pandaa --out o": "did you mean 'panda'?",
    "robots ur10": "did you mean 'ur10e'?",
    "design ./amr.urdf --out o": "did you mean 'arm.urdf'?",
    "design irp6 --criterion conditon --out o": "did you mean condition?",
    "export d --format urdv --out o": "did you mean urdf?",
    "design irp6 --stars 3 --out o": "Did you mean one of: ",
}


@pytest.mark.parametrize("words", CASES)
def test_the_near_name_is_asked_for(words: str, tmp_path: Path, monkeypatch, capfd) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "arm.urdf").write_text("<robot/>")
    ended = Here(tmp_path, monkeypatch, capfd).run(*words.split())
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (2, "", 1)
    assert CASES[words] in ended.stderr


def test_a_name_that_is_like_none_asks_for_nothing() -> None:
    for load, kind in ((load_robot, InputError), (built_in, UnknownName)):
        with pytest.raises(kind) as raised:
            load("spot")
        assert "did you mean" not in str(raised.value)
        assert "irp6-full" in str(raised.value)
