"""The STATUS table of the Baosky blocks TRCV_C and TSEND_C (manual 7.15.1 and 7.15.2): one row a code."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.status import StatusRow
from trcvtui.dialects.baosky_connection_errors import CONNECTION_ERRORS
from trcvtui.dialects.baosky_job_errors import JOB_ERRORS
from trcvtui.dialects.baosky_states import STATES

STATUS: Final[tuple[StatusRow, ...]] = STATES + CONNECTION_ERRORS + JOB_ERRORS
