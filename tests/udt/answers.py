"""The answers of `trcvtui udt` in JSON, read again."""

from __future__ import annotations

import json
from typing import Any

from trcvtui.udt import report
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Data


def show_json(layout: Layout) -> Any:
    return json.loads(report.layout_json(layout))


def decode_json(layout: Layout, data: Data) -> Any:
    return json.loads(report.decoded_json(layout, data))
