"""What is refused, and in which words."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from regressors.errors import InputError


def refusal(read: Callable[..., object], *given: object, begins: str = "", **named: object) -> str:
    """The message with which something is refused: one line."""
    with pytest.raises(InputError) as raised:
        read(*given, **named)
    message = str(raised.value)
    assert message.startswith(begins)
    assert "\n" not in message
    return message
