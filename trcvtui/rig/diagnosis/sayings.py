"""What a rule of the doctor says: how sure, where, the evidence, what mends it."""

from __future__ import annotations

from trcvtui.records import NamedTuple
from trcvtui.rig.diagnosis.line_facts import SaidBytes


class Mend(NamedTuple):
    """One remedy in words; as a bench command, as `--set` of a what-if, None: it is none."""

    text: str
    command: str | None = None
    set: str | None = None


class Said(NamedTuple):
    """What speaks for a cause; `way` is to-plc or from-plc, None: both. `mend`: () is that of the row."""

    confidence: float
    evidence: tuple[str, ...]
    way: str | None = None
    at: SaidBytes | None = None
    instance: str | None = None
    mend: tuple[Mend, ...] = ()
