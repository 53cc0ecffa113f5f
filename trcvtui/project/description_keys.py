"""A connection description back to the keys of its table: the bytes of the DB, and the bench's own keys."""

from __future__ import annotations

from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.connection.description import Description
from trcvtui.net.connection.description_check import Flaw, Meaning, Protocol, meaning
from trcvtui.net.layers.iso_on_tcp import OWN_SIZE_CODE, IsoSettings
from trcvtui.net.layers.tls import TlsSettings
from trcvtui.project.connect_descriptions import NO_SERVER
from trcvtui.project.tls_words import UNSAFE

Keys = list[tuple[str, bool | int | float | str | list[str]]]


def keys_of_description(config: ConnectConfig, description: Description) -> Keys:
    """Return the keys behind `name`; read again they give the same CONNECT."""
    says = meaning(description)
    is_known = config.flaw is None or config.flaw.flaw is not Flaw.NO_DESCRIPTION
    keys: Keys = [("type", description.structure.name)] if is_known else []
    keys.append(("bytes", description.data.hex(" ")))
    if isinstance(config.remote_port, str) and says.protocol is not Protocol.ISO:
        keys.append(("RemotePort", config.remote_port))
    return keys + _of_the_bench(config, says)


def field_keys(config: ConnectConfig, description: Description) -> Keys:
    """Return the same CONNECT by the names of its fields, as somebody writes it who changes one of them."""
    keys: Keys = [("type", description.structure.name)]
    for field in description.structure.fields:
        is_named = field.name == "RemotePort" and isinstance(config.remote_port, str)
        value = config.remote_port if is_named else description.value(field.name)
        keys.append((field.name, f"hex {value.hex(' ')}" if isinstance(value, bytes) else value))
    return [(key, value) for key, value in keys if value != "hex "] + _of_the_bench(
        config, meaning(description)
    )


def plain_keys(config: ConnectConfig, description: Description) -> Keys:
    """Return a CONNECT of plain TCP as one is written that names no structure."""
    says = meaning(description)
    keys: Keys = [] if config.any_local else [("LocalAddress", config.local.address)]
    keys += [("ActiveEstablished", config.active), ("LocalPort", config.local.port)]
    keys += [
        ("RemoteAddress", config.remote_address),
        ("RemotePort", config.remote_port),
        ("ID", says.identity),
    ]
    interface = description.number("InterfaceId")
    keys += [("InterfaceId", interface)] if interface else []
    return keys + [("KeepAliveTimeInterval", config.keep_alive_interval_s)] * bool(
        config.keep_alive_interval_s
    )


def _of_the_bench(config: ConnectConfig, says: Meaning) -> Keys:
    keys: Keys = [] if config.any_local else [("LocalAddress", config.local.address)]
    if says.protocol is Protocol.ISO:
        keys.append(("IsoPort", config.remote_port if config.active else config.local.port))
    elif not config.active and (config.local.port != says.local_port or _takes_free_port(config)):
        keys.append(("ListenPort", config.local.port))
    if says.remote_name and not config.remote_name:
        no_server = config.flaw is not None and config.flaw.flaw is Flaw.NO_RESOLVER
        keys.append(("DnsAnswer", NO_SERVER if no_server else config.remote_address))
    if isinstance(config.session, TlsSettings) and config.session.is_unverified:
        keys.append(("verify", UNSAFE))
    if config.keep_alive_interval_s:
        keys.append(("KeepAliveTimeInterval", config.keep_alive_interval_s))
    return keys


def _takes_free_port(config: ConnectConfig) -> bool:
    return not config.local.port and config.flaw is None


def keys_of_iso(session: IsoSettings) -> Keys:
    """Return what a peer's table says about ISO-on-TCP."""
    tsaps = (("local_tsap", session.local), ("remote_tsap", session.remote))
    keys: Keys = [("iso", True)]
    keys += [(key, f"16#{tsap.hex().upper()}") for key, tsap in tsaps if tsap]
    return keys + ([("tpdu", 1 << session.size_code)] if session.size_code != OWN_SIZE_CODE else [])
