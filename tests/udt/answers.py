"""The answers of `trcvtui udt` as a whole: as one text or one JSON value."""

from __future__ import annotations

import json
from typing import Any

from trcvtui.udt import report
from trcvtui.udt.compare import compare as module
from trcvtui.udt.compare.compare import Comparison
from trcvtui.udt.layout.codec import Data
from trcvtui.udt.layout.layout import Layout


def show_text(layout: Layout) -> str:
    return "\n".join(report.show_text(layout))


def show_json(layout: Layout) -> Any:
    return json.loads(report.show_json(layout))


def decode_text(layout: Layout, data: Data) -> str:
    return "\n".join(report.decode_text(layout, data))


def decode_json(layout: Layout, data: Data) -> Any:
    return json.loads(report.decode_json(layout, data))


def compare_text(both: Comparison, data: bytes) -> tuple[str, bool]:
    rows = list(both.rows(data))
    return "\n".join(module.compare_text(both, rows, data)), module.is_equal(both, rows)


def compare_json(both: Comparison, data: bytes) -> tuple[Any, bool]:
    rows = list(both.rows(data))
    return json.loads("\n".join(module.compare_json(both, rows, data))), module.is_equal(both, rows)
