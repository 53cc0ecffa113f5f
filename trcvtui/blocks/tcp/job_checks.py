"""Whether a job may start: DATA, LEN, ADDR and CONNECT, checked in the manual's order."""

from __future__ import annotations

from typing import Final, NamedTuple

from msgspec.structs import replace

from trcvtui.blocks.block import ConnectBinding
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.data_area import DataArea, ElementKind
from trcvtui.blocks.environment import Environment
from trcvtui.blocks.outcome import Cause, CauseKind, Outcome, cause_of_fault
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.rules import DataAreaRules
from trcvtui.net.connection.config import RemoteAddress
from trcvtui.net.connection.connection import Connection
from trcvtui.net.connection.resources import Claim, DirectionClaims
from trcvtui.net.connection.udp import UdpEndpoint
from trcvtui.net.results import ANY_ADDRESS


class JobRequest(NamedTuple):
    """A request for a job of at most `most` bytes. If `most` is None, the vendor's rules set the limit.

    `least` is the smallest LEN of a text, apart from 0. `rival` is a claim that keeps the job from
    starting. If `needs_len`, LEN = 0 does not mean all of DATA.
    """

    length: int
    adhoc: bool = False
    most: int | None = None
    least: int = 0
    rival: Claim | None = None
    needs_len: bool = False


def acquire(
    env: Environment,
    data: DataArea | None,
    request: JobRequest,
    direction: DirectionClaims,
    claim: Claim,
    connect: str,
) -> Outcome | None:
    """Check DATA and LEN, then claim CONNECT and a buffer. Return what is wrong, or None if all is good."""
    unfit = _find_data_misfit(env, data, request)  # 80A4, 80A5 come before 80C3 and 80A7
    if unfit is not None:
        return unfit
    other = request.rival or direction.try_take(claim)
    if other is not None:
        return Outcome(Condition.CONNECT_IN_USE, in_use_cause(other, claim))
    fault = env.resources.buffers.acquire(connect)
    return Outcome(Condition.NO_BUFFER, cause_of_fault(fault)) if fault is not None else None


def can_start(env: Environment, data: DataArea | None, request: JobRequest) -> bool:
    """Return whether DATA, LEN and `rival` let the requested job start. The buffers are not checked."""
    return request.rival is None and _find_data_misfit(env, data, request) is None


def reserve(
    env: Environment, data: DataArea | None, request: JobRequest, direction: DirectionClaims, claim: Claim
) -> bool:
    """Claim the direction for a job of the next call. Return False if that call would refuse the job."""
    if not can_start(env, data, request) or env.resources.buffers.is_full:
        return False
    return direction.try_take(claim) is None


def _find_data_misfit(env: Environment, data: DataArea | None, request: JobRequest) -> Outcome | None:
    area, length = env.rules.area, request.length
    limit = env.rules.max_len if request.most is None else request.most
    if data is None:
        return replace(_EMPTY, condition=area.missing)
    if data.size == 0:
        return _EMPTY
    unfit = _find_area_misfit(area, data, length, request.adhoc)
    if unfit is not None:
        return unfit
    if request.needs_len and not length and not data.symbolic:
        return _refusal(Condition.LENGTH_WRONG, "LEN is 0, but this block needs a length", "LEN", 0)
    if area.texts_whole and 0 < length < request.least:
        name = f"LEN cuts {data.type_name}: use 0, or {request.least} or more"
        return _refusal(Condition.LEN_OF_TEXT, name, "LEN", length)
    if length > data.size or (length or data.size) > limit:
        return _length_error(env, limit, data, length)
    return None


def find_rival(env: Environment, connection: Connection, claim: Claim) -> Claim | None:
    """If the vendor allows only one priority, return a claim of another priority on this connection."""
    if not env.rules.one_class:
        return None
    found = (direction.find_other_priority(claim) for direction in connection.direction_claims)
    return next((rival for rival in found if rival is not None), None)


def _find_area_misfit(area: DataAreaRules, data: DataArea, length: int, adhoc: bool) -> Outcome | None:
    if area.refuses_bits and data.elements is ElementKind.BITS:
        return _refusal(Condition.DATA_REFUSED, f"DATA is {data.type_name}: single bits are refused")
    if not data.symbolic:
        return None
    if area.symbolic_alone and length:
        return _refusal(Condition.DATA_SYMBOLIC, "DATA is symbolic, so LEN must be 0", "LEN", length)
    if area.symbolic_bytes and adhoc and data.elements is not ElementKind.BYTES:
        return _refusal(Condition.DATA_SYMBOLIC, "ad-hoc with a symbolic DATA needs elements of 8 bits")
    return None


def _refusal(condition: Condition, name: str, pin: str = "DATA", value: int | None = None) -> Outcome:
    return Outcome(condition, Cause(CauseKind.PARAMETER, name, pin=pin, value=value))


def changed_outcome(what: str) -> Outcome:
    return _refusal(Condition.AREA_CHANGED, f"{what} changed while the job ran", pin=what)


def _length_error(env: Environment, most: int, data: DataArea, length: int) -> Outcome:
    limit = min(data.size, most)
    if (length or data.size) > most:
        condition, name = Condition.LENGTH_WRONG, "more bytes than one job can have"
    else:
        condition, name = env.rules.area.longer, "LEN is larger than DATA"
    cause = Cause(CauseKind.PARAMETER, name, pin="LEN", value=length, have=length or data.size, need=limit)
    return Outcome(condition, cause)


def in_use_cause(other: Claim, asking: Claim) -> Cause:
    if other.is_orphan:
        name = "CONNECT still held by an instance that is gone"
        cure = "a disconnect or reset frees the CONNECT"
        return Cause(CauseKind.OWNER, name, detail=cure, holder=other.instance, is_orphan=True)
    if other.priority != asking.priority:
        return Cause(CauseKind.OWNER, "CONNECT in use by a block of another priority", holder=other.instance)
    return Cause(CauseKind.OWNER, "CONNECT in use by another instance", holder=other.instance)


_EMPTY = Outcome(Condition.DATA_EMPTY, Cause(CauseKind.PARAMETER, "DATA has no byte", pin="DATA", value=0))

TARGET_STRUCTURES: Final = ("TADDR_Param",)
SOURCES: Final = ("TADDR_Param", "TADDR_RCV_IP")


def find_misfit(bound: ConnectBinding, needs_datagrams: bool, receives: bool = False) -> Outcome | None:
    """Return why a block can never work on a connection. `needs_datagrams` is True for TUSEND and TURCV."""
    is_udp = isinstance(bound.connection, UdpEndpoint)
    if is_udp and bound.address is None:
        return _addr_error(Condition.OTHER_TRANSPORT, "the connection is UDP, but this block has no ADDR")
    if is_udp and receives and bound.address is not None:
        return find_structure_error(bound.address)
    if needs_datagrams and not is_udp:
        return _addr_error(Condition.OTHER_TRANSPORT, "the connection is not UDP", "CONNECT")
    return None


def target_error(address: RemoteAddress) -> Outcome | None:
    wrong = find_structure_error(address, TARGET_STRUCTURES)
    if wrong is not None:
        return wrong
    if address.address == ANY_ADDRESS:
        return _addr_error(Condition.REMOTE_WRONG, "ADDR holds no address")
    if address.port == 0:
        return _addr_error(Condition.NEEDS_ADDR, "ADDR holds no port")
    return None


def find_structure_error(address: RemoteAddress, accepted: tuple[str, ...] = SOURCES) -> Outcome | None:
    """Return an error if the structure or the size of ADDR is wrong."""
    written = address.description
    if written is None:
        return None
    name, size = written.structure.name, len(written.data)
    if name not in accepted:
        return _addr_error(Condition.NO_DESCRIPTION, f"ADDR is a {name}, but must be a {accepted[0]}")
    if size != written.structure.size:
        text = f"ADDR has {size} bytes, but a {name} has {written.structure.size}"
        return _addr_error(Condition.PARAMETER_WRONG, text)
    return None


def _addr_error(condition: Condition, name: str, pin: str = "ADDR") -> Outcome:
    return Outcome(condition, Cause(CauseKind.PARAMETER, name, pin=pin))


FAULT_SHOWN: Final = Cause(
    CauseKind.WAITING, "the error was shown already; EN_R is 1, LEN and DATA are unchanged"
)


class RepeatedFaultFilter:
    """If `is_once` (switch receive_faults), shows a repeated error once, then the condition `quiet`."""

    def __init__(self, is_once: bool, quiet: Condition) -> None:
        self._is_once = is_once
        self._quiet = Outcome(quiet, FAULT_SHOWN)
        self._last_fault: tuple[Condition, Inputs] | None = None

    def filter_outcome(self, outcome: Outcome, inputs: Inputs) -> Outcome:
        """Return the outcome to show while EN_R is 1: `quiet` for an error that was shown already."""
        if not self._is_once:
            return outcome
        now = (outcome.condition, inputs) if outcome.error else None
        is_repeated, self._last_fault = now is not None and now == self._last_fault, now
        if is_repeated:
            return self._quiet
        return Outcome(outcome.condition, outcome.cause) if outcome.error else outcome  # not stable

    def forget(self) -> None:
        """Treat the next error as new, because EN_R is 0 or the connection has changed."""
        self._last_fault = None
