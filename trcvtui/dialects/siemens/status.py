"""The STATUS table of the Siemens blocks, versions from 3.0 (siemens.md 2): by code, then by block."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.status import StatusRow
from trcvtui.dialects.siemens.connection_errors import CONNECTION_ERRORS
from trcvtui.dialects.siemens.description_errors import DESCRIPTION_ERRORS
from trcvtui.dialects.siemens.job_errors import JOB_ERRORS
from trcvtui.dialects.siemens.parameter_errors import PARAMETER_ERRORS
from trcvtui.dialects.siemens.states import STATES
from trcvtui.dialects.siemens.tls import TLS_ERRORS

STATUS: Final[tuple[StatusRow, ...]] = tuple(
    sorted(
        (*STATES, *PARAMETER_ERRORS, *CONNECTION_ERRORS, *JOB_ERRORS, *DESCRIPTION_ERRORS, *TLS_ERRORS),
        key=lambda row: row.code,
    )
)
