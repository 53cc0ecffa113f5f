"""The records of `--format jsonl`: what they hold for blocks whose outputs differ."""

from __future__ import annotations

import json
from typing import Any

import pytest

from trcvtui.blocks.outcome import Cause, CauseKind
from trcvtui.plc.ledger import Outputs, StatusEdge
from trcvtui.scenario.report import JsonLines

PINS: dict[str, Any] = {"status": 0x7009, "busy": False, "done": True, "error": False}


@pytest.mark.parametrize(
    ("block", "rcvd_len", "last"), [("TRCV_C", 0, ("RCVD_LEN", 0)), ("TSEND_C", None, ("ERROR", False))]
)
def test_a_block_without_rcvd_len_has_no_such_key(block: str, rcvd_len: Any, last: tuple[str, Any]) -> None:
    written: list[str] = []
    edge = StatusEdge("X", block, Outputs(**PINS, rcvd_len=rcvd_len), "", Cause(CauseKind.SEQUENCE, ""))
    JsonLines(written.append, 10_000_000).write_scan(3, [edge])
    (record,) = map(json.loads, written)
    assert list(record)[:5] == ["scan", "t_ms", "instance", "block", "STATUS"]
    assert list(record.items())[-1] == last
