"""Ask the operating system for punctual scans, without privileges; failure is normal and is shown.

Measured in reference/performance.md 2b: timer slack 1 ns and an EEVDF slice of 100 us bring the p99 start
lateness of a 10 ms scan beside a busy screen from 3.8 ms to 0.1 ms. Where the kernel gives each session a
share of the processor (autogroup), the slice counts inside the session only: the engine gets one of its own
and does not pay for what the screen has used. Linux only; elsewhere nothing is asked.
"""

from __future__ import annotations

import ctypes
import gc
import os
import struct
import sys
from typing import Final

SLICE_NS: Final = 100_000
_PR_SET_TIMERSLACK: Final = 29
_SYS_SCHED_SETATTR: Final = {"x86_64": 314, "aarch64": 274}


def be_punctual() -> str:
    """Set what can be set for this process; return in words what was granted."""
    if not sys.platform.startswith("linux"):
        return "default scheduling"
    asked = ("slack", _ask_slack), ("slice", _ask_slice), ("session", _ask_session)
    granted = [name for name, ask in asked if ask()]
    return "+".join(granted) or "default scheduling"


def quiet_collector() -> None:
    """Move what exists out of the cyclic collector's sight and switch it off.

    A full collection took 45 to 138 ms (performance.md); the engine makes no reference cycles while it scans.
    What was moved before is looked at again: a bench that is left behind shall go.
    """
    gc.unfreeze()
    gc.collect()
    gc.freeze()
    gc.disable()


def _ask_slack() -> bool:
    libc = ctypes.CDLL(None, use_errno=True)
    return bool(libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0) == 0)


def _ask_slice() -> bool:
    import platform

    number = _SYS_SCHED_SETATTR.get(platform.machine())
    if number is None:
        return False
    # struct sched_attr: size, policy SCHED_OTHER, flags, nice, priority, slice, deadline, period
    attr = struct.pack("=IIQiIQQQ", 48, 0, 0, 0, 0, SLICE_NS, 0, 0)
    return bool(ctypes.CDLL(None, use_errno=True).syscall(number, 0, attr, 0) == 0)


def _ask_session() -> bool:
    try:
        os.setsid()
    except OSError:  # a leader of its process group already
        return False
    return True
