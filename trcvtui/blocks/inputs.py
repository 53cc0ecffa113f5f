"""The inputs of one call, for every block: each reads the pins that it has."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Inputs:
    """Pins by their manual's names in lower case; `len` in bytes, 0 = size of DATA."""

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
