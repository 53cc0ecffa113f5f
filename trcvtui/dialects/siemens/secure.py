"""Which condition a failure of TLS or of a name is (siemens.md 2.3). Which code covers what is inferred.

A partner who refuses us with an alert, or does not go on, is a failed handshake: the alert stands in the
ledger. A name that does not match is one, too: no code of the table is nearer.
"""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.net.connection.description_check import Flaw
from trcvtui.net.connection.set_up import Stage
from trcvtui.net.tls_words import TlsError

_TLS: Final[dict[str, Condition]] = {
    TlsError.PLAIN: Condition.TLS_MESSAGE,
    TlsError.HANDSHAKE: Condition.TLS_HANDSHAKE,
    TlsError.SILENT: Condition.TLS_HANDSHAKE,
    TlsError.REFUSED: Condition.TLS_HANDSHAKE,
    TlsError.WRONG_NAME: Condition.TLS_HANDSHAKE,
    TlsError.NO_CERTIFICATE: Condition.TLS_UNSUPPORTED,
    TlsError.UNSUPPORTED: Condition.TLS_UNSUPPORTED,
    TlsError.DISCARDED: Condition.TLS_DISCARDED,
    TlsError.NO_CA: Condition.TLS_NO_CA,
    TlsError.EXPIRED: Condition.TLS_EXPIRED,
    TlsError.INTEGRITY: Condition.TLS_INTEGRITY,
    TlsError.EXTENSION: Condition.TLS_EXTENSION,
    TlsError.REFERENCE: Condition.TLS_REFERENCE,
}
_CHANGED: Final = {"EBADMSG": Condition.TLS_INTEGRITY}  # by a planned fault
_NAMES: Final = {
    "EAI_AGAIN": Condition.NO_RESOLVER,
    "EAI_NONAME": Condition.NAME_UNKNOWN,
    "EAI_FAIL": Condition.NAME_UNKNOWN,
}
SECURE_SET_UP: Final[dict[tuple[Stage, str], Condition]] = {
    **{
        (stage, error): shows
        for stage in (Stage.CONNECT, Stage.ACCEPT)
        for error, shows in (_TLS | _CHANGED).items()
    },
    **{(Stage.CONNECT, error): shows for error, shows in _NAMES.items()},
    (Stage.DESCRIPTION, Flaw.SERVER_BARE): Condition.TLS_SERVER_BARE,
    (Stage.DESCRIPTION, Flaw.SECURE_DATAGRAMS): Condition.TLS_DATAGRAMS,
    (Stage.DESCRIPTION, Flaw.CLIENT_ASKS): Condition.TLS_CLIENT_ASKS,
    (Stage.DESCRIPTION, Flaw.SERVER_CHECKS): Condition.TLS_SERVER_CHECKS,
    (Stage.DESCRIPTION, Flaw.CERTIFICATE): Condition.TLS_REFERENCE,
}
