"""Which conditions no Baosky block shows: other vendors' answers to the questionnaire bring them in."""

from __future__ import annotations

from trcvtui.blocks.conditions import Condition

_ORDER = list(Condition)
NOT_BAOSKYS = frozenset(
    {
        Condition.JOB_BEGINS,
        Condition.ESTABLISHED,
        Condition.LINK_DONE,
        Condition.RECEIVING_PART,
        Condition.STARTED,
        Condition.RUNNING,
        Condition.FINISHED,
        Condition.NOTHING_TO_RESET,
        Condition.FRAME_AWAITED,
        Condition.FRAME_PART,
        Condition.FRAME_RECEIVED,
        Condition.FRAME_GAP,
        Condition.BUFFER_EMPTY,
        *_ORDER[_ORDER.index(Condition.PARTNER_CLOSED) + 1 :],
    }
)
