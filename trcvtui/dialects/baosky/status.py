"""The STATUS table of the Baosky TCP blocks (manual 7.15.1, 7.15.2, 7.15.5 to 7.15.9): one row a code."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.status import StatusRow
from trcvtui.dialects.baosky.connection_errors import CONNECTION_ERRORS
from trcvtui.dialects.baosky.inner_blocks import with_inner_blocks
from trcvtui.dialects.baosky.job_errors import JOB_ERRORS
from trcvtui.dialects.baosky.states import STATES

STATUS: Final[tuple[StatusRow, ...]] = with_inner_blocks(STATES + CONNECTION_ERRORS + JOB_ERRORS)
