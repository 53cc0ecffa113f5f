"""Judges a project before its first scan: what its instances expect, and causes that exist already."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from ipaddress import ip_address
from typing import TYPE_CHECKING, Final

from msgspec.structs import replace

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.pins import PinValue
from trcvtui.blocks.table import block_row
from trcvtui.commands import words
from trcvtui.commands.peer import read_routines
from trcvtui.commands.table import collect_written_data, parse_script
from trcvtui.diagnosis.cause_words import CAUSED_CONDITIONS
from trcvtui.diagnosis.causes import weigh_findings
from trcvtui.diagnosis.data_values import find_unwritten_members
from trcvtui.diagnosis.frame_causes import FRAME_RULES
from trcvtui.diagnosis.line_facts import LineFacts, SegmentFacts, make_line_of_writes
from trcvtui.diagnosis.receiver import Receiver
from trcvtui.net.connection.config import ANY_END, LONGEST_KEEP_ALIVE_S, ConnectConfig
from trcvtui.net.connection.description_check import read_spec
from trcvtui.net.connection.resources import IdConflict
from trcvtui.net.connection.set_up import SetUpStage
from trcvtui.net.results import ANY_ADDRESS, parse_octets
from trcvtui.project.project import SERIAL
from trcvtui.snapshots.doctor import Finding, Remedy
from trcvtui.udt.types import Struct

if TYPE_CHECKING:
    from trcvtui.project.project import InstanceDecl, PeerDecl, Project

Pins = dict[str, PinValue]
HeldPins = frozenset[tuple[str, str]]  # instance and input
NO_PINS: Final[HeldPins] = frozenset()
MOST_SAMPLES: Final = 8  # messages of a peer that are judged
LONG_KEEP_ALIVE_S: Final = 1800  # a firewall forgets an idle connection sooner


# -- what instances expect -----------------------------------------------------------------------------------


def list_receivers(
    project: Project, held: HeldPins = NO_PINS, pins: Mapping[str, Pins] | None = None
) -> tuple[Receiver, ...]:
    """Return the receivers of a project, with the inputs that `start` and `program` set.

    No command changes the inputs in `held`. If the project runs, `pins` has the present inputs.
    """
    project, bytes_of = _apply_start(project, held, pins)
    found = [
        _make_receiver(project, each) for each in project.instances if block_row(each.block).receives_on_net
    ]
    if len(found) == 1:
        found = [found[0]._replace(is_only=True)]
    found = [_add_marks(project, each, bytes_of) for each in found]
    return (*found, *_list_serial_receivers(project, bytes_of))


def _apply_start(
    project: Project, held: HeldPins = NO_PINS, now: Mapping[str, Pins] | None = None
) -> tuple[Project, dict[str, bytes]]:
    pins: dict[str, Pins] = {}
    steps = list(_steps(project))
    for step in steps:
        if isinstance(step.command, words.SetInputs):
            known = pins.setdefault(step.command.instance, {})
            for pin, value in step.command.pins:
                if (step.command.instance, pin) not in held:
                    known.setdefault(pin, True if value == "blink" else value)
    instances = tuple(
        [
            replace(each, inputs=tuple({**dict(each.inputs), **(now or pins).get(each.name, {})}.items()))
            for each in project.instances
        ]
    )
    return replace(project, instances=instances), collect_written_data(steps, project)


def _steps(project: Project) -> Iterator[words.Step]:
    for text, place in ((project.start, "start"), (project.program, "program")):
        yield from parse_script(text, project, f"{project.path}: {place}")


def _make_receiver(project: Project, decl: InstanceDecl) -> Receiver:
    inputs = dict(decl.inputs)
    config, udp = project.connect(decl.connect), project.udp_config(decl.connect)
    data = project.data_decl(decl.data) if decl.data else None
    pin = inputs.get("LEN")
    length = pin if isinstance(pin, int) and not isinstance(pin, bool) else 0
    size = data.size if data is not None else 0
    pins = {each.name for each in project.pins(decl.block)}
    has_adhoc = "ADHOC" in pins
    is_adhoc = bool(inputs.get("ADHOC")) if has_adhoc else length in project.rules.area.adhoc_lens
    task = project.task(decl.task)
    is_datagram = udp is not None or (config is not None and config.is_datagram)
    remote = config.remote_port if config is not None else 0
    local = config.local if config is not None else udp.local if udp is not None else ANY_END
    rules = project.rules
    known = rules.status.keys() | rules.status_of.get(decl.block, {}).keys()
    shown = {one: one for one in CAUSED_CONDITIONS}
    if is_datagram and not rules.large_datagram_cut:
        shown[Condition.MESSAGE_TOO_LONG] = rules.datagram_too_long
    return Receiver(
        decl.name,
        decl.connect,
        size if is_adhoc and not has_adhoc else min(length or size, size),
        is_adhoc,
        is_datagram,
        config is not None and config.is_message_oriented and not config.is_datagram,
        task.interval_ns if task is not None else 0,
        config is not None and config.active,
        local.port,
        remote if isinstance(remote, int) else 0,
        data=data.name if data is not None else "",
        type_name=data.type_name if data is not None else "",
        type=data.type if data is not None else None,
        rules=None if data is None else data.choice.rules(project.layout),
        sender="" if data is None else project.types.sender_layout(data.type_name).layout,
        room=size,
        own_address=_address_bytes(local.address),
        partner_address=_address_bytes(config.remote_address if config is not None else ANY_ADDRESS),
        has_reset="COM_RST" in pins,
        static="ADHOC=0 " if has_adhoc else "",
        words={one: rules.status_word(decl.block, own) for one, own in shown.items() if own in known},
        is_secure=config is not None and config.session is not None and not config.is_message_oriented,
        ports=_ports(project),
    )


def _ports(project: Project) -> frozenset[int]:
    some = [port for each in project.connects for port in (each.local.port, each.remote_port)]
    some += [each.local.port for each in project.udp_configs]
    return frozenset(port for port in some if isinstance(port, int) and port)


def _address_bytes(address: str) -> bytes:
    """Return the four bytes of an address. Return b"" for 0.0.0.0 and for a name."""
    found = None if address == ANY_ADDRESS else parse_octets(address)
    return b"" if found is None else bytes(found)


def _add_marks(project: Project, receiver: Receiver, written: dict[str, bytes]) -> Receiver:
    fed = {each.name for each in project.combuffers if each.source == receiver.instance}
    for decl in project.instances:
        if decl.connect in fed and block_row(decl.block).mark_lengths:
            return receiver._replace(marks=_read_marks(decl, written), need=0, type=None)
    return receiver


def _list_serial_receivers(project: Project, written: dict[str, bytes]) -> Iterator[Receiver]:
    lines = {each.name for each in project.combuffers if each.source == SERIAL}
    for decl in project.instances:
        if decl.connect in lines and block_row(decl.block).mark_lengths:
            yield Receiver(decl.name, decl.connect, 0, is_serial=True, marks=_read_marks(decl, written))


def _read_marks(decl: InstanceDecl, written: dict[str, bytes]) -> tuple[bytes, bytes]:
    inputs, marks = dict(decl.inputs), [b"", b""]
    for number, pin in enumerate(block_row(decl.block).mark_lengths[:2]):
        length = inputs.get(pin, 0)
        pointer = decl.pointers[number] if number < len(decl.pointers) else ""
        marks[number] = written.get(pointer, b"")[: length if isinstance(length, int) else 0]
    return marks[0], marks[1]


# -- the rows ------------------------------------------------------------------------------------------------


def lint(
    project: Project, pins: Mapping[str, Pins] | None = None, has_run: bool = True
) -> tuple[Finding, ...]:
    """Return what is wrong with a project, the surest finding first. In a run, `pins` has the inputs."""
    started = replace(_apply_start(project, now=pins)[0], start="", program="")
    found = [replace(one, cause=cause) for cause, judge in LINT_RULES for one in judge(started)]
    written = _written_pins(project)
    found += _judge_two_receivers(started, written)
    if not has_run:  # in a run a command may have set CONT
        found[:0] = _judge_missing_cont(started, written)
    found += _judge_routines(project, pins)
    return tuple(sorted(found, key=lambda one: -one.confidence))


def _judge_limits(project: Project) -> Iterator[Finding]:
    used = [each for each in project.connects if any(i.connect == each.name for i in project.instances)]
    if len(used) > project.connection_limit:
        text = f"{len(used)} CONNECTs are used, {project.model} has {project.connection_limit} connections"
        yield Finding(0.95, (text,), mend=(Remedy("use fewer CONNECTs, or a model with more connections"),))
    priorities = {task.name: task.priority for task in project.tasks}
    for decl in project.instances:
        inputs = dict(decl.inputs)
        length = inputs.get("LEN")
        data = project.data_decl(decl.data) if decl.data else None
        row = block_row(decl.block)
        most = project.rules.max_datagram if row.speaks_udp else project.rules.max_len
        if not isinstance(length, int) or isinstance(length, bool) or not row.uses_network:
            continue
        if data is not None and length > data.size and length not in project.rules.area.adhoc_lens:
            text = f"LEN of {decl.name} is {length}, DATA {data.name} has {data.size} bytes"
            mend = Remedy(f"LEN {data.size}, or 0: all of DATA", f"set {decl.name} LEN={data.size}")
            yield Finding(0.95, (text,), instance=decl.name, mend=(mend,))
        elif length > most:
            text = f"LEN of {decl.name} is {length}, the maximum is {most}"
            yield Finding(0.95, (text,), instance=decl.name, mend=(Remedy(f"LEN {most} or less"),))
    for connect in project.connects:
        on = [each for each in project.instances if each.connect == connect.name]
        if len({priorities.get(each.task) for each in on}) > 1:
            names = ", ".join(each.name for each in on)
            text = f"{names} work on {connect.name} from tasks of different priority"
            yield Finding(0.85, (text,), mend=(Remedy("call all blocks of a CONNECT from one task"),))


def _judge_addr(project: Project) -> Iterator[Finding]:
    for connect in project.connects:
        if connect.is_datagram or connect.description is not None:
            continue
        if connect.active and connect.remote_port == 0:
            text = f"{connect.name} is active and has no RemotePort"
            yield Finding(0.95, (text,), mend=(Remedy("set the RemotePort on which the partner listens"),))
        yield from _judge_peers(project, connect)


def _status_words(project: Project, block: str, condition: Condition) -> tuple[str, ...]:
    """Return the STATUS of a block for a condition, or () if the table of the block has none."""
    known = project.rules.status.keys() | project.rules.status_of.get(block, {}).keys()
    return (f"{project.rules.status_word(block, condition):04X}",) if condition in known else ()


def _judge_ids(project: Project) -> Iterator[Finding]:
    first: dict[int, ConnectConfig] = {}
    mend = (Remedy("give each of them its own ID: one ID is one connection"),)
    for config in project.connects:
        if config.description is None or config.flaw is not None:
            continue
        identity = read_spec(config.description).identity
        other = first.setdefault(identity, config)
        if other is not config:
            how = IdConflict.BUILDING if config.description == other.description else IdConflict.OTHER
            said = Finding(0.95, (f"{config.name}: ID {identity} is that of {other.name}",), mend=mend)
            yield _assign_to_builder(project, config, (SetUpStage.IDENTITY, how), said)


def _judge_ports(project: Project) -> Iterator[Finding]:
    """Yield a finding if two CONNECTs without ISO-on-TCP share a local address and a TCP or UDP port."""
    first: dict[tuple[bool, str, int], ConnectConfig] = {}
    mend = Remedy("give each of them its own LocalPort")
    for config in project.connects:
        local, described = config.local, config.description
        port = local.port if described is None else read_spec(described).local_port
        if not port or config.flaw is not None:
            continue
        other = first.setdefault((config.is_datagram, local.address, port), config)
        if other is not config:
            calls = other.active, config.active
            text = f"{other.name} and {config.name} have one local port, {local.address}:{port}"
            unsure = f"this bench accepts both; some CPUs refuse one, {project.dialect.name} perhaps"
            is_taken = other.local.port == local.port == port and not all(calls)
            said = Finding(0.95 if is_taken else 0.5, (text, unsure)[: 2 - is_taken], mend=(mend,))
            late = other if calls == (True, False) else config  # a caller binds after a listener
            yield _assign_to_builder(project, late, (SetUpStage.BIND, "EADDRINUSE"), said)


def _assign_to_builder(
    project: Project, config: ConnectConfig, wrong: tuple[SetUpStage, str], said: Finding
) -> Finding:
    """Return the finding with the block that builds `config`, and with the STATUS that it will show."""
    for decl in project.instances:
        row = block_row(decl.block)
        if decl.connect == config.name and (row.owns_link or row.runs_as is Condition.ESTABLISHING):
            status = _status_words(project, decl.block, project.rules.course.set_up_condition(*wrong))
            return replace(said, instance=decl.name, status=status)
    return replace(said, confidence=0.5)  # no block builds it: no STATUS shows it


def _judge_peers(project: Project, connect: ConnectConfig) -> Iterator[Finding]:
    calls = {f"@{connect.name}"}
    peers = [each for each in project.peers if not each.udp]
    if connect.active:
        port, callers = connect.remote_port, [each for each in peers if each.end in calls]
        named = [project.peer(port[1:])] if isinstance(port, str) else callers
        for each in [each for each in named if each is not None and each.active][:1]:
            text = f"{connect.name} and {each.name} are both active: neither listens"
            yield Finding(0.95, (text,), mend=(Remedy("make one of them passive"),))
    elif (
        connect.remote_port
        and len(project.connects) == 1
        and peers
        and not any(each.active for each in peers)
    ):
        text = f"{connect.name} and {peers[0].name} are both passive: neither calls"
        yield Finding(0.9, (text,), mend=(Remedy("make one of them active"),))
    for name, text in (("LocalAddress", connect.local.address), ("RemoteAddress", connect.remote_address)):
        try:
            ip_address(text)
        except ValueError:
            if not connect.remote_name or name == "LocalAddress":
                yield Finding(0.9, (f"{name} of {connect.name} is '{text}'",), mend=(Remedy("four numbers"),))


WrittenPins = dict[tuple[str, str], set[PinValue]]


def _written_pins(project: Project) -> WrittenPins:
    """Return all values that each input gets from its declaration, from `start` or from `program`."""
    found = {(each.name, pin): {value} for each in project.instances for pin, value in each.inputs}
    for step in _steps(project):
        match step.command:
            case words.SetInputs(instance, pins):
                for pin, value in pins:
                    found.setdefault((instance, pin), set()).update((0, 1) if value == "blink" else (value,))
            case words.PulsePin(instance, pin):
                found.setdefault((instance, pin), set()).update((0, 1))
    return found


def _judge_missing_cont(project: Project, written: WrittenPins) -> Iterator[Finding]:
    """Yield instances that are to send or receive but never get the CONT that a connection needs."""
    for decl in project.instances:
        pins = {pin.name for pin in project.pins(decl.block)}
        asks = [pin for pin in ("EN_R", "REQ") if any(written.get((decl.name, pin), ()))]
        holds = any(written.get((decl.name, "CONT"), ()))
        if "CONT" not in pins or not asks or holds or project.rules.course.request_connects:
            continue
        name, word = decl.name, f"{project.rules.status_word(decl.block, Condition.NO_JOB):04X}"
        text = f"{asks[0]} is 1, and nothing sets CONT: {name} stays in {word}"
        mend = Remedy("CONT 1: it builds the connection", f"set {name} CONT=1", f"instance.{name}.CONT=true")
        cause = "not-connected-request"
        yield Finding(0.95, (text,), instance=name, mend=(mend,), status=(word,), cause=cause)


def _judge_two_receivers(project: Project, written: WrittenPins) -> Iterator[Finding]:
    """Yield receivers whose EN_R is always 1, on a CONNECT with another such receiver."""
    first: dict[tuple[str, str], InstanceDecl] = {}
    for decl in project.instances:
        is_held = dict(decl.inputs).get("EN_R") and all(written.get((decl.name, "EN_R"), ()))
        other = first.setdefault((decl.connect, decl.task), decl) if is_held else decl
        if other is not decl:
            text = f"{other.name} and {decl.name} both receive on {decl.connect}: only one gets data"
            status = _status_words(project, decl.block, Condition.CONNECT_IN_USE)
            mend = Remedy("keep EN_R at 1 at only one of them", f"set {decl.name} EN_R=0")
            yield Finding(0.85, (text,), instance=decl.name, mend=(mend,), status=status, cause="limits")


def _judge_keep_alive(project: Project) -> Iterator[Finding]:
    for connect in project.connects:
        value = connect.keep_alive_interval_s
        if value > LONG_KEEP_ALIVE_S:
            text = f"KeepAliveTimeInterval of {connect.name} is {value} s: a dead link shows after 3 of them"
            usual = connect.keep_alive_default_s
            more = (connect.keep_alive_limit_note,) if value > LONGEST_KEEP_ALIVE_S else ()
            mend = Remedy(f"set it to 0, which is {usual} s, or to some minutes at most")
            yield Finding(0.7, (text, *more), mend=(mend,))


def _judge_adhoc(project: Project) -> Iterator[Finding]:
    for receiver in list_receivers(project):
        is_stream = not receiver.is_datagram and not receiver.is_whole
        if receiver.adhoc and isinstance(receiver.type, Struct) and is_stream:
            text = f"{receiver.instance} is ad hoc, and DATA is {receiver.type_name} of {receiver.need} bytes"
            more = "a message that comes in two pieces makes two jobs"
            name = receiver.instance
            off = receiver.static.strip() or f"LEN={receiver.need}"
            mend = Remedy(f"{off}: a job ends with the whole type", f"set {name} {off}", None)
            yield Finding(0.6, (text, more), instance=name, mend=(mend,))


def _judge_len(project: Project) -> Iterator[Finding]:
    for receiver in list_receivers(project):
        data = project.data_decl(receiver.data) if receiver.data else None
        if data is None or receiver.adhoc or not receiver.need or receiver.is_datagram:
            continue
        left = find_unwritten_members(receiver, receiver.need)
        if left is not None and left.is_cut:  # between two members the end may be wanted
            name, size = receiver.instance, receiver.need
            text = (
                f"{name} takes {size} bytes of {data.type_name}, which has {data.size}: {left.names} is cut"
            )
            whole = f"LEN={data.size if 0 in project.rules.area.adhoc_lens else 0}"
            mend = Remedy(f"{whole}: all of DATA", f"set {name} {whole}", f"instance.{name}.{whole}")
            yield Finding(0.6, (text,), instance=name, mend=(mend,))


LINT_RULES: Final[tuple[tuple[str, Callable[[Project], Iterator[Finding]]], ...]] = (
    ("limits", _judge_limits), ("address", _judge_addr), ("limits", _judge_ids), ("address", _judge_ports),
    ("no-keep-alive", _judge_keep_alive), ("adhoc-splits", _judge_adhoc), ("members-unwritten", _judge_len),
)  # fmt: skip


# -- the partner's sample bytes ------------------------------------------------------------------------------


def _judge_routines(project: Project, pins: Mapping[str, Pins] | None) -> Iterator[Finding]:
    routines = read_routines(project)
    for receiver in list_receivers(project, pins=pins):
        peer = _find_peer(project, receiver)
        routine = routines.get(peer.name) if peer is not None else None
        if peer is None or routine is None or not routine.says or receiver.is_whole:
            continue
        writes: list[SegmentFacts] = []
        content, now = bytearray(), 0
        for number in range(max(MOST_SAMPLES, len(routine.says))):
            send = routine.says[number % len(routine.says)]
            rest, at = send.payload, now
            for size, gap in zip((*send.split, 0), (*(send.gaps_ns or [send.gap_ns] * 64), 0), strict=False):
                part = rest[:size] if size else rest
                if part:
                    writes.append(SegmentFacts(at, len(content), len(part), 0))
                content += part
                rest = rest[size:] if size else b""
                at += gap
            now = max(at, now) + max(routine.every_ns, 1_000_000_000)
        line = make_line_of_writes("udp" if receiver.is_datagram else "tcp", writes, bytes(content))

        def judge(one: Receiver, line: LineFacts = line) -> dict[str, Finding]:
            made = {row.cause: row.judge(line, one) for row in FRAME_RULES}
            return {cause: each for cause, each in made.items() if each is not None and not each.is_remark}

        for found in weigh_findings(judge(receiver), FRAME_RULES, judge):
            yield replace(found, at=None, evidence=(f"{peer.name} says:", *found.evidence))


def _find_peer(project: Project, receiver: Receiver) -> PeerDecl | None:
    connect = project.connect(receiver.connect)
    for peer in project.peers:
        if peer.end == f"@{receiver.connect}":
            return peer
        if connect is not None and connect.remote_port == f"@{peer.name}":
            return peer
        if connect is not None and not isinstance(peer.end, str):
            port = connect.remote_port if connect.active else connect.local.port
            if port and peer.end.port == port and peer.active != connect.active:
                return peer
    return None
