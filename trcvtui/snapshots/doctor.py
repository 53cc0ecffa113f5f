"""The doctor's findings: one class for the rules, the screen, JSON, the report and MQTT."""

from __future__ import annotations

from msgspec import Struct

from trcvtui.blocks.conditions import Condition


class Remedy(Struct, frozen=True, forbid_unknown_fields=True):
    """One remedy in words, as a bench `command`, and as `set` for a what-if. None means no such form.

    If `tried`, a second check with the remedy found neither this cause nor a new one. Else: only advice.
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
    plc: str
    partner: str
    protocol: str

    def __str__(self) -> str:
        return f"{self.plc} <- {self.partner}"


class Finding(Struct, frozen=True, forbid_unknown_fields=True):
    """One cause: confidence (0 to 1), evidence, place. An empty `mend` means the usual remedies of `cause`.

    `way` is to-plc, from-plc, or "" for both. `at` is UTC in ns, byte of the direction, size, packet. An
    empty `instance` or `connect` means several or none. If `is_fact`, the protocol proves it. A remark is
    no fault. `packets` are numbers in the capture, `filter` is for Wireshark. The cause leads to STATUS
    `status` in hex; `explains` are block symptoms. `t_s` is in the capture, `t_ns` and `scan` in the run.
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
    leads_to: tuple[Condition, ...] | None = None  # None: the conditions of `cause`
    filter: str = ""
    trial: object = None  # of a rule: the remedies that it offers, and how to try them
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
    """The findings, the surest first. The doctor has checked `looks` times, the last time up to `scan`."""

    looks: int = 0
    scan: int = 0
    conversations: int = 0
    findings: tuple[Finding, ...] = ()
    trouble: str = ""
    progress: str = ""  # while it looks: "4.5 s: reads night.pcapng: 40%"
    remarks: tuple[Finding, ...] = ()  # worth knowing, and no fault
    qualities: tuple[str, ...] = ()  # what the captures lack, in sentences
