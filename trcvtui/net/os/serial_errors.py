"""What pyserial raises, as an errno name and as words: often it has words alone, the errno behind them."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from typing import Final

from trcvtui.net.os.errors import error_name
from trcvtui.net.results import Fault

GONE: Final = "EIO"
END: Final = "EOF"  # no errno: the far end has closed the connection in order
MOST_WORDS: Final = 160
NO_RESOLVER: Final = (-3, 11002)  # EAI_AGAIN of Linux, WSATRY_AGAIN
# What pyserial 3.5 says where no call of the system has failed.
SAID: Final = (
    ("socket disconnected", END),
    ("reader thread died", END),
    ("does not seem to support", "ETIMEDOUT"),  # nobody has answered in RFC 2217
    ("timeout while waiting", "ETIMEDOUT"),
)


def fault_of(call: str, problem: BaseException) -> Fault:
    """Return a failure of a port as a Fault."""
    name = next((name for each in _chain(problem) if (name := _name_of(each))), "") or _said(problem)
    words = "".join([letter for letter in str(problem) if letter.isprintable()])
    return Fault(call, name, words=words[:MOST_WORDS])


def _chain(problem: BaseException | None) -> Iterator[BaseException]:
    """Return a problem and those that it was raised behind."""
    while problem is not None:
        yield problem
        problem = problem.__cause__ or problem.__context__


def _name_of(problem: BaseException) -> str:
    number = problem.args[0] if problem.args else None  # of an OSError with words alone it is a text
    if type(problem).__name__ == "gaierror":  # its numbers are no errno
        return "EAI_AGAIN" if number in NO_RESOLVER else "EAI_NONAME"
    if isinstance(number, int) and number in errno.errorcode:  # termios.error is no OSError
        return error_name(OSError(number, ""))
    if isinstance(problem, TimeoutError):
        return "ETIMEDOUT"
    return "EINVAL" if isinstance(problem, ValueError) else ""


def _said(problem: BaseException) -> str:
    return next((name for words, name in SAID if words in str(problem)), GONE)
