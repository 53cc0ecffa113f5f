"""Why the serial port of a ComBuffer is not there, and what to do about it."""

from __future__ import annotations

from typing import Final

from trcvtui.plc.snapshot import ComBufferSnapshot

# Rule: the errno chooses the hint; for any other errno it is the system's own text.

NO_RIGHTS_HINT: Final = (
    "this user may not open it; on Linux its group may, most often dialout (`ls -l` of the port shows it): "
    "sudo usermod -aG dialout $USER, then log in again"
)
GONE_HINT: Final = "the device is gone, or what is connected to the port: is the cable plugged in?"
IN_USE_HINT: Final = "another program has it open"
PORT_HINTS: Final = {
    "EACCES": NO_RIGHTS_HINT,
    "EPERM": NO_RIGHTS_HINT,
    "ENOENT": "there is no such device: is it plugged in, and is this its name?",
    "ENODEV": GONE_HINT,
    "ENXIO": GONE_HINT,
    "EIO": GONE_HINT,
    "EBUSY": IN_USE_HINT,
    "EAGAIN": IN_USE_HINT,
    "ENOTTY": "that is no serial port",
    "EINPROGRESS": "there is no answer yet",
    "ECONNREFUSED": "the host is there, but nothing listens on that TCP port",
    "ECONNRESET": "the far end has reset the connection",
    "EHOSTUNREACH": "the host is unreachable: check address, network and cable",
    "ENETUNREACH": "the host is unreachable: check address, network and cable",
    "ETIMEDOUT": "there is no answer: is the host on, and does it speak this protocol?",
    "EAI_NONAME": "no host of that name is known",
    "EAI_AGAIN": "no name server answers",
    "EOF": "the far end has closed the connection",
}


def describe_port_fault(buffer: ComBufferSnapshot | None) -> str:
    """Return which port is not there and which call reported that; "" if no fault is known."""
    if buffer is None or buffer.is_up or buffer.fault is None:
        return ""
    fault = buffer.fault
    injected = "injected fault: " if fault.injected else ""
    return f"{injected}port {buffer.port} of {buffer.name} is not there: {fault.call} gave {fault.error}"


def port_hint(buffer: ComBufferSnapshot | None) -> str:
    if buffer is None or buffer.is_up or buffer.fault is None:
        return ""
    return PORT_HINTS.get(buffer.fault.error) or buffer.fault.words
