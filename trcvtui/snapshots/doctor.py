"""What the doctor has found: one class from the rule that speaks to the screen, JSON, report and MQTT."""

from __future__ import annotations

from msgspec import Struct

from trcvtui.blocks.conditions import Condition


class Remedy(Struct, frozen=True, forbid_unknown_fields=True):
    """One remedy in words; as a bench command, as `--set` of a what-if, None: it is none.

    `tried`: the evidence was judged again with it, and nothing was left. Any other one is advice.
    """

    text: str
    command: str | None = None
    set: str | None = None
    tried: bool = False

    @property
    def display_line(self) -> str:
        label = "mend" if self.tried else "mend, as advice"
        return f"{label}: {self.text}" + (f"  [{self.command}]" if self.command else "")


class Ends(Struct, frozen=True, forbid_unknown_fields=True):
    """The ends of a conversation, and how they speak."""

    plc: str
    partner: str
    protocol: str

    def __str__(self) -> str:
        return f"{self.plc} <- {self.partner}"


class Finding(Struct, frozen=True, forbid_unknown_fields=True):
    """One cause: how sure, the evidence, where it shows, what mends it; `mend` () is that of the cause.

    `way` is to-plc, from-plc, or "": both; `at` is UTC in ns, byte of the direction, size, packet; `instance`
    and `connect` "": of no one alone. A fact is proved by the protocol; a remark is worth knowing, and no
    fault. `packets` are numbers in the capture, `filter` is for Wireshark; `status` are STATUS words in hex
    that it leads to, `explains` symptoms of blocks. `t_s` is in the capture, `t_ns` and `scan` in the run.
    """

    confidence: float
    evidence: tuple[str, ...]
    way: str = ""
    at: tuple[int, int, int, int] | None = None
    instance: str = ""
    mend: tuple[Remedy, ...] = ()
    is_remark: bool = False
    is_fact: bool = False
    packets: tuple[int, ...] = ()
    status: tuple[str, ...] = ()
    leads_to: tuple[Condition, ...] | None = None  # in place of what the cause leads to
    filter: str = ""
    trial: object = None  # of a rule: what it offers, and how that can be tried
    cause: str = ""
    title: str = ""
    explains: tuple[str, ...] = ()
    scan: int | None = None
    t_s: float | None = None
    t_ns: int | None = None
    ends: Ends | None = None
    connect: str = ""

    @property
    def byte(self) -> int | None:
        return self.at[1] if self.at is not None and self.at[2] else None


class DoctorSnapshot(Struct, frozen=True):
    """What the doctor has found, the surest first; it looked so often, last at the run up to `scan`."""

    looks: int = 0
    scan: int = 0
    conversations: int = 0
    findings: tuple[Finding, ...] = ()
    trouble: str = ""
    progress: str = ""  # while it looks: "4.5 s: reads night.pcapng: 40%"
    remarks: tuple[Finding, ...] = ()  # worth knowing, and no fault
    qualities: tuple[str, ...] = ()  # what the captures lack, as it is shown
