"""The STATUS table of the Siemens _C blocks (siemens.md 2.1 and 2.2): one row a code."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.status import StatusRow

STATUS: Final[tuple[StatusRow, ...]] = ()
