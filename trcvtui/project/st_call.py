"""An instance as Structured Text: its call as in the manual's examples, and the variables that it needs.

Inputs have their present values as literals, so that the pasted call does what the bench does. In-outs
(COM_RST) and outputs are bound to variables such as `TSEND_C_1_DONE`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from trcvtui.blocks.pins import Direction, Pin, PinValue
from trcvtui.blocks.table import BlockRow, block_row, is_time_pin
from trcvtui.errors import mistake
from trcvtui.net.connection.config import AddrParam, ConnectConfig
from trcvtui.project.connect_view import REMARK, FieldLine, addr_declaration, connect_declaration, declaration
from trcvtui.project.project import InstanceDecl, Project
from trcvtui.project.tables import expected_name
from trcvtui.udt.literals import format_duration
from trcvtui.udt.st_value import initial_value

Inputs = Mapping[str, PinValue]
NO_INPUTS: Final[Inputs] = {}
INDENT: Final = "    "
EN: Final = "EN"
POINTER_PREFIX: Final = "p"  # the first letter of a pin that takes an address


class CallForm(NamedTuple):
    """How a call is written. `is_short` omits defaults. `written` maps DATA names to initial bytes."""

    is_short: bool = False
    is_multi: bool = False
    written: Mapping[str, bytes] = {}


WHOLE: Final = CallForm()


def st_text(
    project: Project, names: Sequence[str], inputs: Mapping[str, Inputs] | None = None, form: CallForm = WHOLE
) -> str:
    """Return the variables of these instances as a comment, then their calls; raise UserError.

    `inputs` maps an instance to its present inputs, such as `dict(snapshot.inputs)`; pins and instances
    that are not in `inputs` have their initial values.
    """
    if form.is_multi and not project.dialect.describes_connects:
        raise mistake("trcvtui st --multi", project.dialect.name, "a dialect whose language is SCL")
    given = inputs or {}
    calls = [st_call(project, name, given.get(name, NO_INPUTS), form) for name in names]
    return "\n\n".join([st_variables(project, names, form), *calls])


def st_call(project: Project, name: str, inputs: Inputs = NO_INPUTS, form: CallForm = WHOLE) -> str:
    """Return the call of one instance; raise UserError for a name that is not in the project."""
    decl = _instance(project, name)
    values = {**dict(decl.inputs), **inputs}
    bound = ",\n".join(f"{INDENT}{line}" for line in _bind_pins(project, decl, values, form))
    remark = "" if decl.data or not _row(decl).data_pin else " (* DATA is not bound *)"
    called = f"#{decl.name}" if form.is_multi else f'"{decl.name}"' if _has_db(project, form) else decl.name
    call = f"{called}({remark}\n{bound}\n);"
    return _guard_call(decl, call) if _has_en(project, decl) else call


def _has_db(project: Project, form: CallForm) -> bool:
    """Return whether an instance is a data block, and not a variable."""
    return form.is_short and not form.is_multi and project.dialect.describes_connects


def _pins(project: Project, decl: InstanceDecl, values: Inputs, form: CallForm) -> list[Pin]:
    """Return a call's pins. A short call has only nonzero inputs, plus CONT (TIA) or in-outs (CODESYS)."""
    pins = project.pins(decl.block)
    in_outs = {pin.name for pin in _filter(pins, Direction.IN_OUT)}
    kept = {"CONT"} if project.dialect.describes_connects else in_outs
    kept |= {name for name, value in values.items() if value}
    return [pin for pin in pins if not form.is_short or pin.name in kept]


def _row(decl: InstanceDecl) -> BlockRow:
    return block_row(decl.block)


def _guard_call(decl: InstanceDecl, call: str) -> str:
    inner = "\n".join(f"{INDENT}{line}" for line in call.splitlines())
    does = "sends" if _row(decl).writes_tx_buffer else "clears"
    return f"IF {decl.name}_EN THEN (* every call {does} *)\n{inner}\nEND_IF"


def _has_en(project: Project, decl: InstanceDecl) -> bool:
    return _row(decl).has_com_buffer and any(pin.name == EN for pin in project.pins(decl.block))


def st_variables(project: Project, names: Iterable[str], form: CallForm = WHOLE) -> str:
    """Return the declarations that the calls of these instances need, each once, in a comment."""
    lines: dict[str, None] = {}
    for name in names:
        decl = _instance(project, name)
        lines |= dict.fromkeys(_declarations(project, decl, form))
    return "\n".join(["(* VAR", *(f"{INDENT}{line}" for line in lines), "END_VAR *)"])


def _instance(project: Project, name: str) -> InstanceDecl:
    decl = project.instance(name)
    if decl is None:
        known = [each.name for each in project.instances]
        raise mistake("INSTANCE", f"'{name}'", expected_name(name, known, "instance"))
    return decl


# -- the call --------------------------------------------------------------------------------------------


def _bind_pins(project: Project, decl: InstanceDecl, values: Inputs, form: CallForm) -> Iterator[str]:
    """Yield each pin with its value or variable, in the manual's order: inputs, in-outs, outputs."""
    pins = _pins(project, decl, values, form)
    free = [pin for pin in _filter(pins, Direction.IN) if pin.name != EN]  # EN is the IF around the call
    inputs = [f"{pin.name}:={_literal(pin, values.get(pin.name, 0))}" for pin in free]
    identity = _identity(project, decl)
    at = int(bool(free) and free[0].is_bool)  # in the manual ID comes after REQ or EN_R
    yield from [*inputs[:at], f"ID:={identity}", *inputs[at:]] if identity else inputs
    if not identity or not _row(decl).id_alone:
        link_pin = _row(decl).buffer_pin or ("CONFIG" if decl.on_config else "CONNECT")
        yield f"{link_pin}:={_link_variable(project, decl)}"
    for name, variable in _data_bindings(decl):
        yield f"{name}:={f'ADR({variable})' if name.startswith(POINTER_PREFIX) else variable}"
    if decl.addr is not None:
        yield f"ADDR:={decl.addr}"
    for pin in _filter(pins, Direction.IN_OUT):
        yield f"{pin.name}:={_variable(decl, pin)}"
    for pin in _filter(pins, Direction.OUT):
        yield f"{_pin_name(pin)}=>{_variable(decl, pin)}"


def _link_variable(project: Project, decl: InstanceDecl) -> str:
    if not _row(decl).has_com_buffer:
        return decl.connect
    others = [*(data.name for data in project.data), *(each.name for each in project.instances)]
    taken, name = {other.casefold() for other in others}, decl.connect
    while name.casefold() in taken:
        name += "_Buffer"
    return name


def _data_bindings(decl: InstanceDecl) -> Iterator[tuple[str, str]]:
    row = _row(decl)
    if decl.data is not None and row.data_pin:
        yield row.data_pin, decl.data
    for name, variable in zip(row.pointers, decl.pointers, strict=False):
        if variable:
            yield name, variable


def _identity(project: Project, decl: InstanceDecl) -> str:
    """Return the value of the pin ID, or "" if there is none."""
    if project.dialect.describes_connects and decl.on_config:
        return _configured_id(decl.connect)
    found = project.connection_id(decl.block, decl.connect)
    return "" if found is None else str(found)


def _configured_id(name: str) -> str:
    return f"{name}_ID"


def _filter(pins: Iterable[Pin], direction: Direction) -> list[Pin]:
    return [pin for pin in pins if pin.direction is direction]


def _pin_name(pin: Pin) -> str:
    """Return a pin's name in a call: the first word of its label, such as `DONE` for `DONE (NDR)`."""
    return pin.label.partition(" ")[0] or pin.name


def _variable(decl: InstanceDecl, pin: Pin) -> str:
    return f"{decl.name}_{pin.name}"


def _literal(pin: Pin, value: PinValue) -> str:
    if is_time_pin(pin.name):
        return format_duration(int(value) * 1_000_000)
    return str(bool(value)).upper() if pin.is_bool else str(int(value))


# -- the variables ---------------------------------------------------------------------------------------


def _declarations(project: Project, decl: InstanceDecl, form: CallForm) -> Iterator[str]:
    if not _has_db(project, form):
        yield f"{decl.name} : {decl.block};"
    yield from _connection_declarations(project, decl)
    if _row(decl).has_com_buffer:
        yield f"{_link_variable(project, decl)} : ComBuffer;"
    for _, variable in _data_bindings(decl):
        data = project.data_decl(variable)
        if data is not None:
            content, is_scl = form.written.get(data.name, b""), project.dialect.describes_connects
            value = f" := {initial_value(data.layout, content, is_scl)}" if any(content) else ""
            yield f"{data.name} : {' '.join(data.type_name.split())}{value};"
    if _has_en(project, decl):
        yield f"{decl.name}_EN : BOOL;"
    for pin in _pins(project, decl, dict(decl.inputs), form):
        if pin.direction is not Direction.IN:
            yield f"{_variable(decl, pin)} : {_type_of(decl, pin)};"


def _type_of(decl: InstanceDecl, pin: Pin) -> str:
    """Return the type of a pin as in the manual: Error is an enumeration there, a number on the bench."""
    return "ComError_t" if _row(decl).has_com_buffer and pin.name == "Error" else pin.iec_type


def _connection_declarations(project: Project, decl: InstanceDecl) -> Iterator[str]:
    config, port = project.connect(decl.connect), project.udp_config(decl.connect)
    describes = project.dialect.describes_connects
    if config is not None and config.description is not None:
        yield connect_declaration(config, INDENT)
    elif config is not None:
        yield _record(config.name, "TCP_CONNECTCONFIG", _fields(config))
    if port is not None and describes:
        where = f"UDP, local port {port.local.port or 'of your choice'}, set up in TIA Portal"
        yield f"{_configured_id(port.name)} : CONN_OUC;{REMARK}ID of the configured connection: {where}"
    elif port is not None:
        fields = (f"LocalAddress := {_to_array(port.local.address)}", f"LocalPort := {port.local.port}")
        yield _record(port.name, "UDP_CONFIG", fields)
    for addr in project.addrs:
        if addr.name == decl.addr and describes:
            yield addr_declaration(addr, INDENT)
        elif addr.name == decl.addr:
            yield _record(addr.name, "ADDR_PARAM", _remote_fields(addr))


def _record(name: str, type_name: str, fields: Iterable[str]) -> str:
    return declaration(name, type_name, [FieldLine(field) for field in fields], INDENT)


def _remote_fields(of: AddrParam | ConnectConfig) -> Iterator[str]:
    yield f"RemoteAddress := {_to_array(of.remote_address)}"
    if isinstance(of.remote_port, int):
        yield f"RemotePort := {of.remote_port}"


def _fields(config: ConnectConfig) -> Iterator[str]:
    yield f"ActiveEstablished := {str(config.active).upper()}"
    yield from _remote_fields(config)
    yield f"LocalAddress := {_to_array(config.local.address)}"
    yield f"LocalPort := {config.local.port}"
    yield f"SendDelayOpt := {str(config.send_delay_opt).upper()}"
    yield f"KeepAliveTimeInterval := {config.keep_alive_interval_s}"


def _to_array(address: str) -> str:
    return f"[{address.replace('.', ', ')}]"
