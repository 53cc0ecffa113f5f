"""Assigns conversations to CONNECTs of the project, or to ad-hoc CONNECTs.

Rule 1: the addresses and the calling end are taken from the wire; the CONNECT's settings are ignored.
Rule 2: conversations of one PLC end go to one CONNECT, one after the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from ipaddress import ip_address
from pathlib import Path
from typing import Final, NamedTuple, TypeVar, cast

from msgspec.structs import replace

from trcvtui.bench.program import read_program
from trcvtui.blocks.pins import Direction, PinValue
from trcvtui.blocks.table import block_row
from trcvtui.capture.plc_end import NO_KNOWN_ENDS, KnownEnds, PlcEnd, PlcGuess, guess_plc, parse_plc
from trcvtui.capture.reassembly import Conversation, WireDirection
from trcvtui.commands import words
from trcvtui.errors import mistake
from trcvtui.net.connection.config import AddrParam, ConnectConfig, UdpConfig
from trcvtui.net.results import ANY_ADDRESS, Endpoint, parse_end
from trcvtui.net.serial_line import SerialSettings
from trcvtui.net.tap import format_end, parse_place
from trcvtui.project.file import read_project
from trcvtui.project.project import (
    SERIAL,
    SIMULATED,
    ComBufferDecl,
    InstanceDecl,
    Project,
    TapDecl,
    WatchDecl,
)
from trcvtui.scenario.scenario import read_start_steps

MOST_AD_HOC_ENDS: Final = 256  # PLC ends with ad-hoc shadows
NEVER_NS: Final = 1 << 62
_DATAGRAM_SERVICES: Final = {
    53: "DNS", 67: "DHCP", 68: "DHCP", 123: "NTP", 137: "NetBIOS", 138: "NetBIOS", 546: "DHCP", 547: "DHCP",
    1900: "SSDP", 5353: "mDNS", 5355: "LLMNR",
}  # fmt: skip
STAND_IN_ADDRESS: Final = "10.0.0.1"  # for captured addresses that a simulated PLC cannot have
DEFAULT_ON_PINS: Final = ("EN_R", "CONT")  # 1 if neither project nor program sets them
AD_HOC_BYTES: Final = 65535  # of an ad-hoc job, if the dialect allows it


ShadowChoice = tuple[Path | None, str | None, str | None]  # project, PLC end, dialect; None: not chosen
AnySocket = ConnectConfig | UdpConfig
AnyLink = AnySocket | ComBufferDecl
OneLink = TypeVar("OneLink", ConnectConfig, UdpConfig, ComBufferDecl)


class ShadowEnd(NamedTuple):
    """One end of a conversation as the partner of a CONNECT. With `plays_plc`, it is the PLC end.

    With `calls`, the end calls the CONNECT. Datagrams may go to a UDP_CONFIG, serial bytes to a ComBuffer.
    """

    connect: str
    plays_plc: bool
    calls: bool


class ShadowPlan(NamedTuple):
    """The project of the shadows, and for each conversation number its ShadowEnds or why it has none."""

    project: Project
    parts: dict[int, tuple[ShadowEnd, ...]]
    unassigned: dict[int, str]
    guesses: dict[int, PlcGuess]
    notes: tuple[str, ...] = ()  # what another dialect does not have


def find_directions(guess: PlcGuess, conversation: Conversation) -> tuple[WireDirection, WireDirection]:
    """Return the directions of the PLC end and its partner. `guess` may come from an earlier reading."""
    there, back = conversation.there, conversation.back
    is_there = guess.says.conversation.there is guess.says
    return (there, back) if is_there else (back, there)


def _plc_listens(conversation: Conversation, guess: PlcGuess) -> bool:
    return conversation.listener in (None, guess.says)


def _guess_plc_ends(
    found: Iterable[Conversation], given: PlcEnd | None, known: KnownEnds, why_not: dict[int, str]
) -> dict[int, tuple[Conversation, PlcGuess]]:
    usable = {}
    for each in found:
        guess = guess_plc(each, given, known)
        if given is not None and guess.why != "--plc" and each.protocol != "serial":
            why_not[each.number] = "it is not a conversation of this PLC"
        else:
            usable[each.number] = each, guess
    return usable


# -- without a project ---------------------------------------------------------------------------------------


def plan_ad_hoc(found: Sequence[Conversation], plc: str | None, dialect: str) -> ShadowPlan:
    """Return a plan with two TRCV_Cs for each PLC end: one for bytes to it, one for bytes from it."""
    rules = read_project({"dialect": dialect}, "--dialect", Path()).rules
    of_bytes = f"ARRAY[0..{min(AD_HOC_BYTES, rules.max_len) - 1}] OF BYTE"
    base = read_project(
        {"dialect": dialect, "data": [{"name": "bytes", "type": of_bytes}]}, "--dialect", Path()
    )
    unassigned: dict[int, str] = {}
    usable = _guess_plc_ends(found, None if plc is None else parse_plc(plc), NO_KNOWN_ENDS, unassigned)
    names: dict[tuple[object, ...], str] = {}
    parts: dict[int, tuple[ShadowEnd, ...]] = {}
    connects: list[ConnectConfig] = []
    used = {
        _end_key(*usable[n]) for n, (each, _) in usable.items() if each.is_established or begins_late(each)
    }
    for number, (each, guess) in usable.items():
        key, listens = _end_key(each, guess), _plc_listens(each, guess)
        why_not = _explain_no_shadow(base, each, plc is not None) if each.protocol != "tcp" else ""
        if why_not or key not in used:
            unassigned[number] = why_not or "no connection was built"
            continue
        if key not in names and len(names) == MOST_AD_HOC_ENDS:
            unassigned[number] = f"only {MOST_AD_HOC_ENDS} PLC ends get a shadow"
            continue
        if key not in names:
            names[key] = f"C{abs(number)}"
            ends, is_udp = (guess.says.address, guess.says.other.address), each.protocol == "udp"
            there = _make_connect(names[key], not listens, *ends)
            back = _make_connect(f"{names[key]}_BACK", listens, *ends[::-1], is_free=True)
            connects += [replace(c, active=False, is_datagram=True) if is_udp else c for c in (there, back)]
        name = names[key]
        parts[number] = ShadowEnd(name, False, listens), ShadowEnd(f"{name}_BACK", True, not listens)
    return ShadowPlan(_add_instances(base, connects), parts, unassigned, _extract_guesses(usable))


def _end_key(conversation: Conversation, guess: PlcGuess) -> tuple[object, ...]:
    if conversation.tap:
        return "tap", conversation.tap
    if conversation.protocol == "udp":
        return "udp", guess.says.address
    if _plc_listens(conversation, guess):
        return "listens", guess.says.address
    return "calls", guess.says.address[0], guess.says.other.address


def _explain_no_shadow(base: Project, conversation: Conversation, is_asked: bool) -> str:
    """Return why datagrams or a serial line get no ad-hoc shadow, or "" if they get a shadow."""
    if conversation.protocol == "serial":
        return "a serial line needs a ComBuffer of a project"
    if not any(block_row(block).speaks_udp for block in base.dialect.blocks):
        return f"UDP: no block of {base.dialect.name} receives datagrams"
    ends = conversation.there.address, conversation.back.address
    service = next((_DATAGRAM_SERVICES[port] for _, port in ends if port in _DATAGRAM_SERVICES), "")
    return "" if is_asked or not service else f"UDP: {service}"


def begins_late(conversation: Conversation) -> bool:
    """Return whether the capture begins inside a connection, and has bytes of the connection."""
    return not conversation.begins_with_syn and bool(
        conversation.there.byte_count or conversation.back.byte_count
    )


def _extract_guesses(usable: dict[int, tuple[Conversation, PlcGuess]]) -> dict[int, PlcGuess]:
    return {number: guess for number, (_, guess) in usable.items()}


def _make_local_address(packed: bytes) -> str:
    address = ip_address(packed)
    usable = address.version == 4 and not (
        address.is_loopback or address.is_multicast or address.is_unspecified
    )
    return str(address) if usable else STAND_IN_ADDRESS


def make_endpoint(end: tuple[bytes, int]) -> Endpoint:
    """Return an end of a capture for the simulated network. The address of a serial line is its name."""
    if end[1] < 0:
        return Endpoint(end[0].decode(errors="replace"), 0)
    address = ip_address(end[0])
    return Endpoint(str(address) if address.version == 4 else f"[{address}]", end[1])


def _make_connect(
    name: str, active: bool, own: tuple[bytes, int], partner: tuple[bytes, int], is_free: bool = False
) -> ConnectConfig:
    """Return a CONNECT at an end of the capture. With `is_free`, the CONNECT gets any free port."""
    local = _make_local_address(own[0])
    port = 0 if active or is_free or local == STAND_IN_ADDRESS else own[1]
    return ConnectConfig(
        name,
        active,
        Endpoint(local, port),
        make_endpoint(partner).address if active else ANY_ADDRESS,
        partner[1] if active else 0,
        any_local=True,
    )


def _receives_by_itself(project: Project, block: str) -> bool:
    row = block_row(block)
    return (
        row.receives_on_net and not row.speaks_udp and any(pin.name == "CONT" for pin in project.pins(block))
    )


def _has_udp_config(block: str) -> bool:
    row = block_row(block)
    return row.receives_on_net and row.speaks_udp and not row.datagrams


def _add_instances(base: Project, connects: Sequence[ConnectConfig]) -> Project:
    of_streams = next(name for name in base.dialect.blocks if _receives_by_itself(base, name))
    of_configs = next((name for name in base.dialect.blocks if _has_udp_config(name)), "")
    data, instances, addrs = [], [], []
    for config in connects:
        number, _, back = config.name.partition("_")
        name = f"{number}_FROM_PLC" if back else f"{number}_TO_PLC"
        on_config = config.is_datagram and bool(of_configs)
        block = of_configs if on_config else of_streams
        known = {pin.name for pin in base.pins(block) if pin.direction is Direction.IN}
        inputs: list[tuple[str, PinValue]] = [(pin, True) for pin in DEFAULT_ON_PINS if pin in known]
        longest = {"LEN": base.rules.max_datagram} if config.is_datagram else {}
        inputs += (base.adhoc_inputs(block) | longest).items()
        data.append(replace(base.data[0], name=f"{name}_data"))
        addr = f"{name}_ADDR" if config.is_datagram else None
        addrs += [AddrParam(addr)] if addr else []
        pins = tuple(inputs)
        instances.append(InstanceDecl(name, block, config.name, data[-1].name, "MAIN", pins, addr, on_config))
    rules = replace(base.rules, buffers=NEVER_NS, queue=NEVER_NS)
    return _set_network(
        replace(
            base,
            path=Path("watch"),
            connection_limit=NEVER_NS,
            rules=rules,
            connects=tuple([c for c in connects if not (c.is_datagram and of_configs)]),
            udp_configs=tuple([UdpConfig(c.name, c.local) for c in connects if c.is_datagram and of_configs]),
            addrs=tuple(addrs),
            data=tuple(data),
            instances=tuple(instances),
        )
    )


# -- of a project --------------------------------------------------------------------------------------------


def list_known_ends(project: Project) -> KnownEnds:
    """Return a project's ports and addresses of its PLC and partners."""
    calls = [each for each in project.connects if each.active]
    sockets: tuple[AnySocket, ...] = (*project.connects, *project.udp_configs)
    listening: tuple[AnySocket, ...] = (*(c for c in project.connects if not c.active), *project.udp_configs)
    called = frozenset(each.remote_port for each in calls if isinstance(each.remote_port, int))
    return KnownEnds(
        frozenset(each.local.port for each in listening) - {0},
        called - {0},
        _list_hosts(each.local.address for each in sockets),
        _list_hosts(each.remote_address for each in project.connects),
    )


def _list_hosts(addresses: Iterable[str]) -> frozenset[bytes]:
    """Return addresses as packed bytes; names and any-addresses (0.0.0.0) are left out."""
    found = (parse_end(each) for each in addresses if each != ANY_ADDRESS)
    return frozenset(end[0] for end in found if end is not None and any(end[0]))


def make_watch_rows(taps: Sequence[TapDecl]) -> tuple[WatchDecl, ...]:
    """Return [[watch]] rows for the conversations of taps; a serial line has no ends, and so no row."""
    places = [(tap, parse_place(tap.to, f"[[tap]] {tap.name}: to")) for tap in taps if tap.connect]
    return tuple(
        WatchDecl(tap.name, format_end(to.address, to.port), tap.connect, back=tap.back)
        for tap, to in places
        if to.kind != "serial"
    )


def plan_for_project(found: Sequence[Conversation], project: Project, plc: str | None) -> ShadowPlan:
    """Return a plan with the links that a project's [[watch]] rows name, else the only link that fits."""
    given = None if plc is None else parse_plc(plc)
    unassigned: dict[int, str] = {}
    rows = [(parse_plc(w.plc), parse_plc(w.partner) if w.partner else None, w) for w in project.watches]
    usable = _guess_plc_ends(found, given, list_known_ends(project), unassigned)
    parts: dict[int, tuple[ShadowEnd, ...]] = {}
    taken: dict[str, AnyLink] = {}
    ends: set[tuple[bytes, int]] = set()  # PLC ends that have a link
    for number, (each, guess) in tuple(usable.items()):
        name, back = None, ""
        for end, partner, row in rows if given is None else ():
            if _protocol_of(_link(project, row.connect)) != each.protocol or each.tap not in ("", row.name):
                continue
            of_row = guess_plc(each, end)
            if of_row.why == "--plc" and _is_at(of_row.says.other.address, partner):
                name, back, guess = row.connect, row.back, of_row._replace(why=f"[[watch]] {row.name}")
                usable[number] = each, guess
                break
        listens = _plc_listens(each, guess)
        if name is None and (given is not None or not rows or each.protocol == "serial"):
            name = _find_fitting_link(project, guess, listens, given is not None)
        if name is None:
            kind = "ComBuffer" if each.protocol == "serial" else "CONNECT"
            unassigned[number] = f"no {kind} of the project fits, or several fit"
            continue
        if name not in taken:
            is_free = guess.says.address in ends
            taken[name] = _adapt_link(_link(project, name), guess, listens, is_free)
            ends.add(guess.says.address)
        if each.protocol == "tcp" and getattr(taken[name], "active", None) == listens:
            unassigned[number] = f"{name} has the other role (active or passive) in an earlier conversation"
            continue
        parts[number] = (ShadowEnd(name, False, listens),)
        if back:
            if back not in taken:
                other = PlcGuess(guess.says.other, 1.0, "")
                taken[back] = _adapt_link(_link(project, back), other, not listens, is_free=True)
            parts[number] += (ShadowEnd(back, True, not listens),)
    set_by = _find_written_pins(project)
    instances = tuple(
        [_switch_on(project, each, set_by) if each.connect in taken else each for each in project.instances]
    )
    made = replace(
        project,
        peers=(),
        connects=_replace_links(project.connects, taken),
        udp_configs=_replace_links(project.udp_configs, taken),
        combuffers=_replace_links(project.combuffers, taken),
        instances=instances,
    )
    return ShadowPlan(_set_network(made), parts, unassigned, _extract_guesses(usable))


def _replace_links(links: tuple[OneLink, ...], taken: dict[str, AnyLink]) -> tuple[OneLink, ...]:
    return tuple([cast(OneLink, taken.get(each.name) or _disable_link(each)) for each in links])


def _is_at(address: tuple[bytes, int], end: PlcEnd | None) -> bool:
    return end is None or (end.address == address[0] and end.port in (None, address[1]))


def _protocol_of(link: AnyLink) -> str:
    if isinstance(link, ComBufferDecl):
        return "serial"
    return "udp" if isinstance(link, UdpConfig) or link.is_datagram else "tcp"


def _link(project: Project, name: str) -> AnyLink:
    found = project.connect(name) or project.udp_config(name) or project.combuffer(name)
    if found is None:
        raise mistake(f"{project.path}: watch", f"'{name}'", "a CONNECT of the project")
    return found


def _find_fitting_link(project: Project, guess: PlcGuess, listens: bool, is_given: bool) -> str | None:
    """Return the only link with this port. If none, `--plc` takes the only link of this role, or of all."""
    protocol = guess.says.conversation.protocol
    if protocol == "serial":
        return _find_fitting_line(project, guess.says.address[0].decode(errors="replace"))
    receiving = {i.connect for i in project.instances if block_row(i.block).receives_on_net}
    if protocol == "udp":
        return _find_fitting_socket(project, receiving, guess.says.address[1], is_given)
    known = [c for c in project.connects if c.name in receiving and not c.is_datagram]
    port = guess.says.address[1] if listens else guess.says.other.address[1]
    of_port = [
        c for c in known if port == (c.remote_port if c.active else c.local.port) and c.active != listens
    ]
    partner = frozenset((guess.says.other.address[0],))
    of_port = [c for c in of_port if _list_hosts((c.remote_address,)) == partner] or of_port
    of_role = [c for c in known if c.active != listens]
    for fits in (of_port, of_role, known) if is_given else (of_port,):
        if len(fits) == 1:
            return fits[0].name
        if fits and fits is of_port:
            return None
    return None


def _find_fitting_line(project: Project, line: str) -> str | None:
    read = {each.connect for each in project.instances if block_row(each.block).reads_rx_buffer}
    known = [b.name for b in project.combuffers if b.name in read and b.source in (SIMULATED, SERIAL)]
    return line if line in known else known[0] if len(known) == 1 else None


def _find_fitting_socket(project: Project, receiving: set[str], port: int, is_given: bool) -> str | None:
    """Return the only receiver of datagrams at a port. If none has it, `--plc` takes the only receiver."""
    links: tuple[AnySocket, ...] = (*(c for c in project.connects if c.is_datagram), *project.udp_configs)
    known = [each for each in links if each.name in receiving]
    of_port = [each.name for each in known if each.local.port == port]
    if len(of_port) == 1:
        return of_port[0]
    return known[0].name if is_given and len(known) == 1 and not of_port else None


def _adapt_link(config: AnyLink, guess: PlcGuess, listens: bool, is_free: bool) -> AnyLink:
    """Return a link with the captured ends. With `is_free`, the link gets any free port."""
    if isinstance(config, ComBufferDecl):
        return replace(config, source=SERIAL, serial=SerialSettings(config.name))
    own, other = guess.says.address, guess.says.other.address
    if isinstance(config, UdpConfig) or config.is_datagram:
        made = _make_connect(config.name, False, own, other, is_free)
        return replace(config, local=made.local)
    made = _make_connect(config.name, not listens, own, other, is_free)
    return replace(
        config,
        active=made.active,
        local=made.local,
        remote_address=made.remote_address,
        remote_port=made.remote_port,
        remote_name="",
        any_local=True,
    )


def _disable_link(config: AnyLink) -> AnyLink:
    if isinstance(config, ComBufferDecl):
        return config
    if isinstance(config, UdpConfig):
        return replace(config, local=Endpoint(STAND_IN_ADDRESS, 0))
    return replace(
        config,
        local=Endpoint(STAND_IN_ADDRESS, 0),
        remote_address=STAND_IN_ADDRESS if config.active else config.remote_address,
        remote_name="",
        any_local=True,
    )


def _find_written_pins(project: Project) -> set[tuple[str, str]]:
    written: set[tuple[str, str]] = set()
    for step in (*read_start_steps(project), *read_program(project)):
        match step.command:
            case words.SetInputs(instance, pins):
                written |= {(instance, pin) for pin, _ in pins}
            case words.PulsePin(instance, pin):
                written.add((instance, pin))
    return written


def _switch_on(project: Project, decl: InstanceDecl, set_by: set[tuple[str, str]]) -> InstanceDecl:
    known = {pin.name for pin in project.pins(decl.block) if pin.direction is Direction.IN}
    given = {name for name, _ in decl.inputs}
    on = [(pin, True) for pin in DEFAULT_ON_PINS if pin in known - given and (decl.name, pin) not in set_by]
    return replace(decl, inputs=(*decl.inputs, *on))


def _set_network(project: Project) -> Project:
    ends: tuple[AnySocket, ...] = (*project.connects, *project.udp_configs)
    own = tuple(dict.fromkeys((STAND_IN_ADDRESS, *(config.local.address for config in ends))))
    policy = replace(project.rules.policy, attempt_limit_ns=NEVER_NS)
    return replace(
        project,
        rules=replace(project.rules, policy=policy),
        sim=replace(project.sim, addresses=own, not_ethernet=(), latency_ns=0, fragment=False),
    )
