"""What a pane may ask for. It is done at once, so that commands go out in the order of the keys."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple


class Voice(NamedTuple):
    """Send a bench command line; open the prompt with the beginning of one; say what is missing."""

    submit: Callable[[str], None]
    open_prompt: Callable[[str], None]
    complain: Callable[[str], None]
