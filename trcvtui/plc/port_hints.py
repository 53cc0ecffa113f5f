"""Why the serial port of a ComBuffer is not there, and what to do about it."""

from __future__ import annotations

from typing import Final

from trcvtui.plc.snapshot import ComBufferSnapshot

# Rule: the errno chooses the hint; for any other errno it is the system's own text.

NO_RIGHTS_HINT: Final = (
    "this user may not open the port; on Linux, join its group (`ls -l` shows it, most often dialout): "
    "sudo usermod -aG dialout $USER, then log in again"
)
GONE_HINT: Final = "the port or the device on it is gone: is the cable plugged in?"
IN_USE_HINT: Final = "another program has the port open"
PORT_HINTS: Final = {
    "EACCES": NO_RIGHTS_HINT,
    "EPERM": NO_RIGHTS_HINT,
    "ENOENT": "there is no such device: is it plugged in, and is the name right?",
    "ENODEV": GONE_HINT,
    "ENXIO": GONE_HINT,
    "EIO": GONE_HINT,
    "EBUSY": IN_USE_HINT,
    "EAGAIN": IN_USE_HINT,
    "ENOTTY": "this is not a serial port",
    "EINPROGRESS": "there is no answer yet",
    "ECONNREFUSED": "the host is there, but nothing listens on that TCP port",
    "ECONNRESET": "the far end has reset the connection",
    "EHOSTUNREACH": "the host is unreachable: check address, network and cable",
    "ENETUNREACH": "the host is unreachable: check address, network and cable",
    "ETIMEDOUT": "there is no answer: is the host on, and does it speak this protocol?",
    "EAI_NONAME": "the name of the host is unknown",
    "EAI_AGAIN": "no name server answers",
    "EOF": "the far end has closed the connection",
}


def describe_port_fault(buffer: ComBufferSnapshot | None) -> str:
    """Return which port is not there and which call reported that, or "" if no fault is known."""
    if buffer is None or buffer.is_up or buffer.fault is None:
        return ""
    fault = buffer.fault
    injected = "injected fault: " if fault.injected else ""
    return f"{injected}port {buffer.port} of {buffer.name} is not there: {fault.call} gave {fault.error}"


def port_hint(buffer: ComBufferSnapshot | None) -> str:
    if buffer is None or buffer.is_up or buffer.fault is None:
        return ""
    return PORT_HINTS.get(buffer.fault.error) or buffer.fault.words
