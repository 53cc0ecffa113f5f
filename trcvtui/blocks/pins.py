"""The pins of blocks, and the inputs of one call. Each block reads the inputs that it has."""

from __future__ import annotations

from enum import StrEnum

from msgspec import Struct

PinValue = int  # of a BOOL pin False or True


class Direction(StrEnum):
    IN = "in"
    IN_OUT = "in_out"
    OUT = "out"


class Pin(Struct, frozen=True):
    """One pin. A pin with `edge` acts on its rising edge. `label`, if any, is drawn instead of `name`.

    `shows` is the field of Outcome that an output pin shows.
    """

    name: str
    direction: Direction
    iec_type: str
    text: str
    edge: bool = False
    label: str = ""
    shows: str = ""

    @property
    def is_bool(self) -> bool:
        return self.iec_type == "BOOL"


class Inputs(Struct, frozen=True):
    """The input pins, with the manual's names in lower case. `len` is in bytes; 0 is the size of DATA."""

    en_r: bool = False
    req: bool = False
    cont: bool = False
    len: int = 0
    adhoc: bool = False
    com_rst: bool = False
    # of the blocks on a ComBuffer
    en: bool = False
    reset: bool = False
    timeout: int = 0  # ms
    lenprefix: int = 0
    lensuffix: int = 0
    sizereceivedata: int = 0
    length: int = 0
    sendbyte: int = 0
