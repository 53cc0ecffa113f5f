"""May a job start? The manual's questions to DATA, LEN and the CONNECT, in its order (design 6, row 16)."""

from __future__ import annotations

from trcvtui.blocks.cause import Cause, Why, cause_of
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import Environment
from trcvtui.blocks.outcome import Outcome
from trcvtui.net.ownership import Claim, Direction


def refuse(
    env: Environment,
    data: DataArea | None,
    length: int,
    direction: Direction,
    claim: Claim,
    connect: str,
    most: int | None = None,
) -> Outcome | None:
    """Return why no job can start: 80A4, 80A5, 80C3, then a buffer; None: claim and buffer are taken.

    `most` bytes fit into one job, None: as many as the rules say for a connection.
    """
    limit = env.rules.max_len if most is None else most
    if data is None or data.size == 0:
        return _EMPTY
    if length > data.size or (length or data.size) > limit:
        return _wrong_length(env, limit, data, length)
    other = direction.take(claim)
    if other is not None:
        return Outcome(Condition.CONNECT_IN_USE, _in_use(other))
    fault = env.resources.buffers.acquire(connect)
    return Outcome(Condition.NO_BUFFER, cause_of(fault)) if fault is not None else None


def _wrong_length(env: Environment, most: int, data: DataArea, length: int) -> Outcome:
    limit = min(data.size, most)
    if (length or data.size) > most:
        condition, name = Condition.LENGTH_WRONG, "longer than one job can be"
    else:
        condition, name = env.rules.longer_than_data, "LEN is larger than DATA"
    cause = Cause(Why.PARAMETER, name, pin="LEN", value=length, have=length or data.size, need=limit)
    return Outcome(condition, cause)


def _in_use(other: Claim) -> Cause:
    if other.is_orphan:
        name = "an instance that is gone still holds this CONNECT"
        return Cause(Why.OWNER, name, detail=f"{other.instance}: disconnect or reset frees it")
    return Cause(Why.OWNER, "another instance works on this CONNECT", detail=other.instance)


_EMPTY = Outcome(Condition.DATA_EMPTY, Cause(Why.PARAMETER, "DATA has no byte", pin="DATA", value=0))
