"""What a machine can check of the words of every message; `tests/builders/messages.py` prints them for a reader."""

from __future__ import annotations

import re
from functools import cache

import click
from messages import Message, messages

from excite.cli.main import cli
from excite.cli.options import flag_of
from excite.cli.streams import in_options
from excite.tasks.option import options_of
from excite.tasks.task import PARTS

OTHERS = ("ros2 run", "ros2 action", "record.py", "pip install")  # command lines of other programs
FORBIDDEN = (
    r"\b(stands twice|(is|are|be) told|as doubtful as|hardly moves? beside|what cannot be|yardsticks?|bent|curved"
    r"|turns? (over|its direction|within)|turning\b(?! (joint|drive))|resting (joint|link)s?|surroundings|slow starts?"
    r"|the ways?|by itself|what (is|was) said|lanes|twins?|stray(s|ed)?)\b"
)


@cache
def every_message() -> list[Message]:
    """Messages of the whole program."""
    return messages()


def of_the_library() -> list[Message]:
    """Those that do not belong to the command line."""
    return [message for message in every_message() if not message.place.startswith("excite/cli/")]


def wrong(chosen: list[Message], pattern: str) -> list[str]:
    """Messages in which a pattern is found, with their places."""
    return [f"{message.place}: {message.text}" for message in chosen if re.search(pattern, message.text)]


def test_messages_are_found() -> None:
    kinds = {message.kind for message in every_message()}
    assert kinds == {"docstring", "error", "help", "text"}
    texts = {message.text for message in every_message()}
    assert "{}; `replace` replaces it, or choose another {}" in texts  # a raised error's base class
    assert "List built-in robots, or show one: joints, limits, base parameters." in texts


def test_messages_of_the_library_name_no_flag() -> None:
    own = [message for message in of_the_library() if not any(program in message.text for program in OTHERS)]
    assert wrong(own, r"(?<![-\w])--[a-z{]") == []


def test_messages_of_the_library_name_no_command() -> None:
    commands = "|".join(sorted(cli.list_commands(click.Context(cli))))
    assert wrong([m for m in of_the_library() if m.kind != "docstring"], rf"'excite ({commands})") == []


def test_messages_are_no_riddles() -> None:
    assert wrong(every_message(), f"(?i){FORBIDDEN}") == []


def test_errors_have_no_double_and_no_trailing_spaces() -> None:
    errors = [message for message in every_message() if message.kind in ("error", "docstring")]
    assert wrong(errors, r"\S  +\S|[^:]\s$") == []


def test_every_option_of_a_task_is_typed_as_its_message_says() -> None:
    options = [(field.name, option) for part in PARTS.values() for field, option in options_of(part)]
    assert {name: in_options(f"`{name}`") for name, _ in options} == {name: flag_of(name, o) for name, o in options}


def test_options_and_calls_are_typed() -> None:
    typed = {
        "give `torque_margin`": "give --torque-margin",
        "`drop='nan'` leaves it out": "--drop nan leaves it out",
        "`approach_and_return=False` leaves it out": "--no-approach-and-return leaves it out",
        "`friction=True` fits it": "--friction fits it",
        "lower `percent` of `plan_friction`": "lower --speeds of 'excite friction plan'",
        "`replace` replaces it": "--force replaces it",
        "call it within `with jax.enable_x64(True):`": "call it within `with jax.enable_x64(True):`",
    }
    assert {message: in_options(message) for message in typed} == typed
