"""Finds which end of a conversation is the PLC, by the user's word or as a guess with its reason."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from ipaddress import ip_address
from typing import Final, NamedTuple

from trcvtui.capture.reassembly import SENT_END, Conversation, WireDirection
from trcvtui.errors import UserError, mistake
from trcvtui.net.results import parse_end

# The first three bytes of MACs, as the IEEE gave them.
_MACS: Final = {
    "Beckhoff": "000105",
    "Bosch Rexroth": "000B0F 006034",
    "Mitsubishi Electric": "002692 080070 104B46 28E98E 30BE3B 38E08E 58528A 588D39 94A4B5",
    "Omron": "00000A 3CF7D1",
    "Phoenix Contact": "00A045 A8741D CCCCEA",
    "Pilz": "000248",
    "Rockwell Automation": "0000BC 001D9C 086195 184C08 34C0F9 404101 5C2167 5C8816 68C8EB BCF499 E48EBB "
    "E49069 F45433",
    "Schneider Electric": "000054 000417 0080F4 9C0E51",
    "Siemens": "0001E3 000BA3 000E8C 001B1B 001C06 001FF8 080006 10DFFC 208756 20A8B9 286336 301389 302F1E "
    "30B851 384B24 40ECF8 4CE705 681FD8 683E02 789F87 883F99 8CF319 AC6417 D4F527 E0DCA0 E8EF22 EC1C5D",
    "WAGO": "0030DE",
}
VENDOR_BY_MAC: Final = {bytes.fromhex(mac): name for name, macs in _MACS.items() for mac in macs.split()}

# ISO-on-TCP, Modbus, TRCV_C as manuals show it, IEC 104, OPC UA, FINS, DNP3, EtherNet/IP, ADS.
USUAL_PORTS: Final = frozenset({102, 502, 2000, 2404, 4840, 9600, 20000, 44818, 48898})


class PlcEnd(NamedTuple):
    """The PLC end that `--plc` names: its address as bytes, and its port. A port of None means any port."""

    address: bytes
    port: int | None


class PlcGuess(NamedTuple):
    """Which end is the PLC: the direction in which it sends, the confidence (0 to 1, 1: known), and why."""

    says: WireDirection
    confidence: float
    why: str


def parse_plc(text: str) -> PlcEnd:
    """Return the end for a text such as `10.0.0.5`, `10.0.0.5:2000`, `fd00::1` or `[fd00::1]:2000`."""
    found = parse_end(text)
    if found is None:
        raise mistake("--plc", f"'{text}'", "10.0.0.5, 10.0.0.5:2000 or [fd00::1]:2000")
    return PlcEnd(*found)


class KnownEnds(NamedTuple):
    """What a project or a recorded run says about the ends of its PLC.

    The PLC listens on ports `listens` and calls ports `calls`. `own` and `partners` are addresses.
    `connects` has the CONNECT of a run for each pair of PLC port and partner (as text).
    """

    listens: frozenset[int] = frozenset()
    calls: frozenset[int] = frozenset()
    own: frozenset[bytes] = frozenset()
    partners: frozenset[bytes] = frozenset()
    connects: Mapping[tuple[int, str], str] = {}

    def find_connect(self, plc: WireDirection) -> str:
        """Return the CONNECT of a run to which a conversation belongs, "" where none is known."""
        port, partner = plc.address[1], address_text(plc.other.address)
        pairs = ((port, partner), (port, ""), (0, partner))
        return next((self.connects[pair] for pair in pairs if pair in self.connects), "")

    def guess(self, conversation: Conversation) -> PlcGuess | None:
        ends, listener = (conversation.there, conversation.back), conversation.listener
        for some, confidence, why in (
            ([end for end in ends if self.find_connect(end)], 0.95, "the run had it"),
            ([end for end in ends if end.address[0] in self.own], 0.85, "the address of the project"),
            ([end for end in ends if end.other.address[0] in self.partners], 0.85, "the project's partner"),
            ([end for end in ends if end.address[1] in self.listens], 0.8, "port {} of the project"),
        ):
            if len(some) == 1:
                return PlcGuess(some[0], confidence, why.format(some[0].address[1]))
        if listener is not None and listener.address[1] in self.calls:
            return PlcGuess(listener.other, 0.8, f"port {listener.address[1]}: the project calls it")
        return None


NO_KNOWN_ENDS: Final = KnownEnds()


def guess_plc(
    conversation: Conversation, given: PlcEnd | None = None, known: KnownEnds = NO_KNOWN_ENDS
) -> PlcGuess:
    """Return the PLC end: as given, else from our recording or the project, else guessed from the packets."""
    ends = (conversation.there, conversation.back)
    if given is not None:
        fits = [
            end for end in ends if end.address[0] == given.address and given.port in (None, end.address[1])
        ]
        if fits:
            return PlcGuess(fits[-1], 1.0, "--plc")
    if conversation.protocol == "serial":
        sends = next(end for end in ends if end.address[1] == SENT_END)
        return PlcGuess(sends, 0.6, "the capturing side sent these bytes")
    if conversation.sent is not None:
        return PlcGuess(ends[not conversation.sent], 1.0, "it is the recording's PLC")
    found = known.guess(conversation)
    if found is not None:
        return found
    usual = [end for end in ends if end.address[1] in USUAL_PORTS]
    if len(usual) == 1:
        return PlcGuess(usual[0], 0.75, f"port {usual[0].address[1]}, usual at PLCs")
    vendors = [end for end in ends if end.mac[:3] in VENDOR_BY_MAC]  # devices of many kinds have them
    if len(vendors) == 1:
        return PlcGuess(vendors[0], 0.7, f"MAC of {VENDOR_BY_MAC[vendors[0].mac[:3]]}")
    if conversation.listener is not None:
        return PlcGuess(conversation.listener, 0.6, "it listens: the SYN was sent to it")
    lower = min(ends, key=lambda end: end.address[1])
    if ends[0].address[1] == ends[1].address[1]:
        return PlcGuess(conversation.back, 0.2, "the first packet was sent to it")
    return PlcGuess(lower, 0.3, "it has the lower port, so it may listen")


def make_no_match_error(where: str, given: str, found: Iterable[Conversation], offer: str = "") -> UserError:
    """Return the error that no conversation fits an end or a project; it lists up to 8 ends of the capture.

    `offer` comes before the list of ends, and says what the user can do with an end.
    """
    ends = sorted({address_text(end.address) for each in found for end in (each.there, each.back)})
    return mistake(where, given, f"{offer}one of the ends in the capture: " + ", ".join(ends[:8]))


def address_text(end: tuple[bytes, int]) -> str:
    """Return an end as `10.0.0.5:2000` or `[fd00::1]:2000`, or a serial line as `serial:NAME`."""
    if end[1] < 0:
        return f"serial:{end[0].decode(errors='replace')}"
    address = ip_address(end[0])
    return f"{address}:{end[1]}" if address.version == 4 else f"[{address}]:{end[1]}"
