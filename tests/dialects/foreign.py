"""Which conditions no Baosky block shows: other vendors' answers to the questionnaire bring them in."""

from __future__ import annotations

from trcvtui.blocks.conditions import Condition

_ORDER = list(Condition)
NOT_BAOSKYS = frozenset({Condition.JOB_BEGINS, *_ORDER[_ORDER.index(Condition.PARTNER_CLOSED) + 1 :]})
