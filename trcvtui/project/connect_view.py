"""A CONNECT's description byte for byte, as a person reads it: what the screen shows beside the DB."""

from __future__ import annotations

from typing import Final, NamedTuple

from trcvtui.net.connection.config import ConnectConfig as ConnectConfig
from trcvtui.net.connection.description import Row as Row
from trcvtui.net.connection.description import rows
from trcvtui.net.connection.description_check import Flaw, Protocol, field_name, meaning
from trcvtui.project.secure_view import WARNING, certificate_remarks, security_of

TYPE_FIELDS: Final = ("ConnectionType", "connection_type")
INTERFACE_FIELDS: Final = ("InterfaceId", "local_device_id")


class DescriptionView(NamedTuple):
    """One description: its structure, what it says in one line, its rows, and what a CPU finds wrong.

    `warning`: what the project has switched off.
    """

    structure: str
    says: str
    rows: tuple[Row, ...]
    flaw: str
    warning: str = ""


def description_view(config: ConnectConfig, listens: str = "") -> DescriptionView | None:
    """Return the view of a CONNECT, None where the dialect has no descriptions.

    `listens`: the end where it really listens now, "" while it does not.
    """
    description = config.description
    if description is None:
        return None
    flaw = config.flaw
    remarks = _remarks(config) | certificate_remarks(config)
    if flaw is not None:
        remarks[flaw.field] = f"! {flaw.text}"
    security = security_of(config)
    return DescriptionView(
        structure=description.structure.name,
        says=_says(config, listens),
        rows=rows(description, remarks),
        flaw=flaw.text if flaw is not None else "",
        warning=WARNING if security is not None and security.is_unsafe else "",
    )


def _says(config: ConnectConfig, listens: str) -> str:
    assert config.description is not None
    if config.flaw is not None and config.flaw.flaw is Flaw.NO_DESCRIPTION:
        return "no connection description"
    protocol = meaning(config.description).protocol
    if protocol in (Protocol.UNKNOWN, Protocol.CONFIGURED):
        return str(protocol)
    security = security_of(config)
    spoken = f"{protocol}, {security.text}" if security is not None else str(protocol)
    if config.active:
        return f"{spoken}, active to {config.remote_address}:{config.remote_port}"
    return f"{spoken}, passive on {_own_end(config, listens)}"


def _own_end(config: ConnectConfig, listens: str) -> str:
    if config.local.port:
        return str(config.local)
    return f"{listens}, a free port" if listens else f"{config.local.address}, a free port"


def _remarks(config: ConnectConfig) -> dict[str, str]:
    """Return what the bench has put in the place of a field, by field name."""
    assert config.description is not None
    says = meaning(config.description)
    found = dict.fromkeys(TYPE_FIELDS, str(says.protocol))
    where = "where routing says" if config.any_local else config.local.address
    found |= dict.fromkeys(INTERFACE_FIELDS, f"on the bench: {where}")
    if isinstance(config.remote_port, str):
        found[field_name(config.description, "RemotePort")] = f"on the bench: {config.remote_port}"
    if says.protocol is not Protocol.ISO and not config.active and config.local.port != says.local_port:
        found[field_name(config.description, "LocalPort")] = (
            f"on the bench: {config.local.port or 'a free port'}"
        )
    if says.remote_name and config.remote_address != says.remote_address:
        found["RemoteQDN"] = f"on the bench: {config.remote_address}"
    if says.protocol is Protocol.ISO:
        port = config.remote_port if config.active else config.local.port or "a free one"
        found[field_name(config.description, "ActiveEstablished")] = f"port: {port}"
    return found
