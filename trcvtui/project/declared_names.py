"""The names in a project: each is declared once, and each that is used is declared.

Rule: instances and DATA share their names, because `expect NAME` means either; so do CONNECTs, UDP_CONFIGs
and peers, because `@NAME` means any of them. `peer` is a word of the bench commands and no name for an
instance or DATA.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Final

from trcvtui.blocks.parameters import BUFFER_PIN, POINTERS
from trcvtui.project.names import expected_name, parse_reference
from trcvtui.project.project import SERIAL, SIMULATED
from trcvtui.project.tables import TRUTH, Given, Table, shown

WORDS: Final = ("peer",)
Named = tuple[str, Sequence[Table]]  # kind of table, its tables


def find_duplicates(kinds: Iterable[Named], reserved: Iterable[str] = ()) -> None:
    """Record every name that an earlier table of these kinds has, or that is reserved."""
    seen = dict.fromkeys(reserved, "a word of the bench commands")
    for kind, tables in kinds:
        for table in tables:
            name = table.peek("name")
            if not isinstance(name, str):
                continue
            if name in seen:
                table.wrong("name", f"{shown(name)}, {seen[name]}", "a name of its own")
            seen.setdefault(name, f"the name of another {kind}")


@dataclass(frozen=True, slots=True)
class Names:
    """The declared names of a project, asked by those who use them."""

    tasks: tuple[str, ...]
    data: tuple[str, ...]
    connects: tuple[str, ...]
    peers: tuple[str, ...]
    udp_configs: tuple[str, ...] = ()
    addrs: tuple[str, ...] = ()
    combuffers: tuple[str, ...] = ()
    receivers: tuple[str, ...] = ()  # instances of TRCV_C
    serial_lines: tuple[str, ...] = ()  # ComBuffers with a port
    senders: tuple[str, ...] = ()  # instances of TSEND_C
    describes: bool = field(default=False, kw_only=True)  # a CONNECT is a connection description

    def check_connect(self, table: Table) -> None:
        """Record a RemotePort, or an IsoPort, that names nothing."""
        for key in ("RemotePort", "IsoPort"):
            name = parse_reference(table.text(key))
            if name is not None:
                _check(table, key, name, (*self.peers, *self.connects), "peer or CONNECT")

    def check_addr(self, table: Table) -> None:
        """Record a RemotePort that names nothing that speaks UDP."""
        for key in ("RemotePort", "rem_port_nr"):
            name = parse_reference(table.text(key))
            if name is not None:
                _check(table, key, name, (*self.peers, *self._udp_ends()), "peer or UDP_CONFIG")

    def check_peer(self, table: Table) -> None:
        """Record a remote that names no CONNECT; with `udp`, no UDP_CONFIG."""
        name = parse_reference(table.text("remote"))
        if name is None:
            return
        if _is_true(table.peek("udp")):
            _check(table, "remote", name, self._udp_ends(), "UDP_CONFIG")
        else:
            _check(table, "remote", name, self.connects, "CONNECT")

    def check_combuffer(self, table: Table) -> None:
        """Record a source that is nothing from which bytes can come."""
        known = (SIMULATED, SERIAL, *self.receivers, *(n for n in self.combuffers if n != table.peek("name")))
        name = table.text("source")
        if name is not None:
            _check(table, "source", name, known, "source")
        line = table.text("line")
        if line is not None:
            what = 'TSEND_C, or ComBuffer with source = "serial"'
            _check(table, "line", line, (*self.serial_lines, *self.senders), what)

    def _udp_ends(self) -> tuple[str, ...]:
        """Return what may receive datagrams: a CONNECT can be of UDP, where it is a description."""
        return (*self.udp_configs, *self.connects) if self.describes else self.udp_configs

    def check_message(self, table: Table) -> None:
        """Record a peer that does not exist."""
        name = table.text("peer")
        if name:
            _check(table, "peer", name, self.peers, "peer")

    def check_instance(self, table: Table) -> None:
        """Record a CONNECT, DATA or task that does not exist."""
        uses = (
            ("connect", self.connects, "CONNECT"),
            ("config", self.udp_configs, "UDP_CONFIG"),
            ("addr", self.addrs, "ADDR"),
            ("data", self.data, "DATA"),
            *((key, self.combuffers, "ComBuffer") for key in sorted(set(BUFFER_PIN.values()))),
            *((key, self.data, "DATA") for key in sorted(set(chain(*POINTERS.values())))),
            ("task", self.tasks or ("MAIN",), "task"),
        )
        for key, names, what in uses:
            name = table.text(key)
            if name is not None:
                _check(table, key, name, names, what)


def _is_true(value: object) -> bool:
    return bool(TRUTH.from_text(value.text) if isinstance(value, Given) else TRUTH.read(value))


def _check(table: Table, key: str, name: str, names: Sequence[str], what: str) -> None:
    if name not in names:
        table.wrong(key, shown(name), expected_name(name, names, what))
