"""What is asked of the next scan: frozen values, applied in phase 1 and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass

PinValue = bool | int


@dataclass(frozen=True, slots=True)
class SetInput:
    """Write one input pin; it holds until changed. Ends a blink of that pin."""

    instance: str
    pin: str
    value: PinValue


@dataclass(frozen=True, slots=True)
class PulseInput:
    """TRUE in exactly the next scan in which the instance is called, FALSE from the one after."""

    instance: str
    pin: str


@dataclass(frozen=True, slots=True)
class BlinkInput:
    """Toggle the pin in every scan, as the manual's ST example does with REQ."""

    instance: str
    pin: str


@dataclass(frozen=True, slots=True)
class WriteData:
    """Overwrite `payload` bytes of the global variable `data` from byte `offset`."""

    data: str
    offset: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class PlcStop:
    """CPU STOP: blocks are not called, connections close, STATUS 0000, outputs FALSE."""


@dataclass(frozen=True, slots=True)
class PlcRun:
    """CPU RUN: fresh instances; inputs and DATA keep their values."""


Command = SetInput | PulseInput | BlinkInput | WriteData | PlcStop | PlcRun
