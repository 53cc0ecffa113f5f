"""A project in another dialect: the same program, wires and partners with the answers of another vendor.

Rule: the conversion makes nothing up. A part that the other dialect does not have is left out, with a note.
A CONNECT that the other dialect cannot describe is refused.
"""

from __future__ import annotations

from typing import NamedTuple

from msgspec.structs import replace

from trcvtui.blocks.table import known_blocks
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.dialect import Dialect, SwitchValue, format_value, read_switches
from trcvtui.errors import Problem, UserError, mistake
from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.connection.description import Description
from trcvtui.net.connection.description_check import (
    DescriptionFlaw,
    Flaw,
    Transport,
    check_strict_tsap,
    read_spec,
    to_tcon_param,
)
from trcvtui.net.layer import tls_credentials_of
from trcvtui.net.layers.iso_on_tcp import IsoSettings
from trcvtui.net.results import ANY_ADDRESS, Endpoint
from trcvtui.project.descriptions import LOOPBACK
from trcvtui.project.key_rows import context_of
from trcvtui.project.keys import read_table
from trcvtui.project.project import DataDecl, InstanceDecl, Project
from trcvtui.project.tables import Table, expected_name, quote
from trcvtui.udt.layout.layout import lay_out
from trcvtui.udt.layout.rules import LayoutRules, rules_for


class Translation(NamedTuple):
    """A project in another dialect; each note says in one line what was left out or chosen."""

    project: Project
    notes: tuple[str, ...]


def find_dialect(name: str) -> Dialect:
    if name not in DIALECTS:
        raise mistake("--dialect", quote(name), expected_name(name, DIALECTS, "dialect"))
    return DIALECTS[name]


def convert_project(project: Project, dialect: Dialect) -> Translation:
    """Return the project in that dialect. Raise UserError if the dialect cannot describe a CONNECT."""
    if dialect.name == project.dialect.name:
        return Translation(project, ())
    notes: list[str] = []
    options = _convert_options(project, dialect, notes)
    model = project.model if project.model in dialect.models else dialect.default_model
    layout = rules_for(dialect.layout)
    other = replace(
        project,
        dialect=dialect,
        model=model,
        connection_limit=dialect.models[model],
        options=options,
        rules=dialect.answer(options),
        layout=layout,
        data=tuple(_convert_data(decl, layout) for decl in project.data),
    )
    other = replace(
        other,
        connects=tuple(_convert(c, n, project, other, notes) for n, c in enumerate(project.connects, 1)),
        instances=_convert_instances(project, other, notes),
    )
    return Translation(other, tuple(notes))


# -- switches ----------------------------------------------------------------------------------------------


def _convert_options(project: Project, dialect: Dialect, notes: list[str]) -> dict[str, SwitchValue]:
    known = {switch.name for switch in dialect.switches}
    raw: dict[str, object] = {}
    for switch in project.dialect.switches:
        value = project.options.get(switch.name, switch.default)
        if value == switch.default:
            continue
        text = format_value(switch, value)
        if switch.name in known:
            raw[switch.name] = text
        else:
            notes.append(f"option {switch.name} = {text} is left out: {dialect.name} has no such switch")
    values, problems = read_switches(dialect, raw, "option")
    for problem in problems:
        name = problem.where.removeprefix("option.")
        notes.append(f"option {name} = {raw[name]} is left out: here it takes {problem.expected}")
    return values


# -- DATA, instances -----------------------------------------------------------------------------------------


def _convert_data(decl: DataDecl, rules: LayoutRules) -> DataDecl:
    layout = lay_out(decl.type, decl.choice.rules(rules), decl.name)
    return replace(decl, layout=layout, size=layout.size)


def _convert_instances(project: Project, other: Project, notes: list[str]) -> tuple[InstanceDecl, ...]:
    blocks = known_blocks(other.dialect.blocks)
    kept = []
    for decl in project.instances:
        if decl.block in blocks:
            kept.append(_convert_pins(decl, project, other, notes))
        else:
            notes.append(f"{decl.name} is left out: {other.dialect.name} has no {decl.block}")
    return tuple(kept)


def _convert_pins(decl: InstanceDecl, project: Project, other: Project, notes: list[str]) -> InstanceDecl:
    pins, inputs = {pin.name for pin in other.pins(decl.block)}, dict(decl.inputs)
    was, now = project.adhoc_inputs(decl.block), other.adhoc_inputs(decl.block)
    is_adhoc = inputs.get("ADHOC") or inputs.get("LEN", 0) in project.rules.area.adhoc_lens
    if was != now and was and now and is_adhoc:  # ADHOC in one dialect, a special LEN in another
        inputs = {name: value for name, value in inputs.items() if name not in was} | now
    for name in inputs:
        if name not in pins:
            notes.append(f"{decl.name}: {name} is left out: {decl.block} has no such pin")
    return replace(decl, inputs=tuple((name, value) for name, value in inputs.items() if name in pins))


# -- CONNECTs ------------------------------------------------------------------------------------------------


def _convert(
    config: ConnectConfig, number: int, project: Project, other: Project, notes: list[str]
) -> ConnectConfig:
    if config.description is None and other.dialect.describes_connects:
        return _add_description(config, number, other, notes)
    if config.description is not None and not other.dialect.describes_connects:
        return _convert_to_plain_tcp(config, config.description, project, other, notes)
    if isinstance(config.session, IsoSettings):
        policy = other.rules.policy
        own = replace(config.session, cap=other.rules.max_len, default_dt_bytes=policy.tpdu_default)
        flaw = check_strict_tsap(config.session.local) if policy.narrow_tsaps else None
        config = replace(config, session=own, flaw=config.flaw or flaw)
    return _convert_structure(config, other.dialect, notes)


def _convert_structure(config: ConnectConfig, dialect: Dialect, notes: list[str]) -> ConnectConfig:
    """Return a CONNECT in a structure that the other dialect takes. If no structure fits, add a flaw."""
    description, taken = config.description, dialect.structures
    if description is None or not taken or description.structure.name in taken:
        return config
    is_plain = tls_credentials_of(config.session) is None
    has_interface = bool(description.number("InterfaceId"))
    found = to_tcon_param(read_spec(description), has_interface) if is_plain else None
    if found is not None:
        notes.append(f"{config.name}: {description.structure.name} is written as a {found.structure.name}")
        return replace(config, description=found)
    text = f"{description.structure.name}: {dialect.name} takes {', '.join(taken)} only"
    notes.append(f"{config.name}: {text}")
    return replace(config, flaw=DescriptionFlaw(Flaw.STRUCTURE, "", text), session=None)


def _add_description(config: ConnectConfig, number: int, other: Project, notes: list[str]) -> ConnectConfig:
    record: dict[str, object] = {
        "name": config.name,
        "ActiveEstablished": config.active,
        "LocalPort": config.local.port,
        "RemoteAddress": config.remote_address,
        "RemotePort": config.remote_port,
        "KeepAliveTimeInterval": config.keep_alive_interval_s,
    }
    if config.local.address != ANY_ADDRESS:
        record["LocalAddress"] = config.local.address
    else:
        notes.append(f"{config.name}: LocalAddress {ANY_ADDRESS} is left out: a description names none")
    if config.send_delay_opt:
        notes.append(f"{config.name}: SendDelayOpt is left out: a description has no such field")
    problems: list[Problem] = []
    table = Table(record, f"{other.dialect.name}: connect {config.name}", problems)
    described: ConnectConfig | None = read_table("connect", table, context_of(other), number)
    if problems or described is None:
        raise UserError(problems)
    return replace(described, history=config.history)


def _convert_to_plain_tcp(
    config: ConnectConfig, description: Description, project: Project, other: Project, notes: list[str]
) -> ConnectConfig:
    _require_plain_tcp(config, description, other)
    notes.append(
        f"{config.name}: {description.structure.name} is written as a TCP_CONNECTCONFIG, without its ID"
    )
    local = config.local
    if config.any_local:
        local = Endpoint(next(iter(project.sim.addresses), LOOPBACK), local.port)
        notes.append(f"{config.name}: LocalAddress {local.address} is chosen: the description names none")
    if config.flaw is not None:
        notes.append(f"{config.name}: {config.flaw.text}: {other.dialect.name} does not check that")
    return ConnectConfig(
        name=config.name,
        active=config.active,
        local=local,
        remote_address=config.remote_address,
        remote_port=config.remote_port,
        keep_alive_interval_s=config.keep_alive_interval_s,
        history=config.history,
    )


def _require_plain_tcp(config: ConnectConfig, description: Description, other: Project) -> None:
    spec = read_spec(description)
    found = ""
    if spec.protocol is not Transport.TCP:
        found = f"{spec.protocol} ({description.structure.name})"
    elif config.session is not None:
        found = f"a secure connection ({description.structure.name})"
    elif spec.remote_name and config.remote_address == ANY_ADDRESS:
        found = f"a partner by name ({spec.remote_name})"
    if found:
        raise mistake(f"{other.dialect.name}: connect {config.name}", found, "plain TCP by address")
