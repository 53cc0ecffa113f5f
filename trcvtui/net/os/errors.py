"""Errno numbers of this system as POSIX names: numbers differ between systems, names do not."""

from __future__ import annotations

import errno
from typing import Final

SAME_ERROR: Final = {"EWOULDBLOCK": "EAGAIN", "ENOTSUP": "EOPNOTSUPP"}


def error_name(problem: OSError | ValueError | KeyError) -> str:
    """Return the POSIX name of a failure; an unknown handle and a closed socket object are EBADF."""
    if not isinstance(problem, OSError):
        return "EBADF"
    name = errno.errorcode.get(problem.errno or 0, f"E{problem.errno}").removeprefix("WSA")
    return SAME_ERROR.get(name, name)
