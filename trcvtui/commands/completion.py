"""Completion of bench commands: the words that may come next, from tables and the names of the project."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from trcvtui.blocks.table import block_row
from trcvtui.commands.peer import ALL_PEER_VERBS as PEER_VERBS
from trcvtui.commands.reader import can_be_fed
from trcvtui.commands.tokens import FORMS
from trcvtui.project.edit import command_keys_of, fields_of, find_kinds, propose_name
from trcvtui.project.keys import OFFERED_KINDS as KINDS
from trcvtui.project.keys import names_of
from trcvtui.project.project import Project
from trcvtui.project.proposals import NEW

NextWords = Callable[[list[str], Project], Iterable[str]]
PEER_COMMANDS: Final = ("send", *sorted(set(PEER_VERBS) - {"send"}))
COMMON_TYPES: Final = ("ARRAY[0..", "BYTE", "WORD", "DWORD", "INT", "DINT", "REAL", "LREAL", "STRING[")
SEND_MODES: Final = tuple(FORMS)
SEND_OPTIONS: Final = ("split=", "gap=T#", "repeat=", "every=T#")
FAULT_CALLS: Final = (
    "recv", "connect", "bind", "listen", "accept", "socket", "send", "shutdown", "close", "set_reuse",
    "poll_add", "poll_del", "abort", "resolve", "buffer", "queue", "clear",
)  # fmt: skip
FAULT_ERRORS: Final = (
    "ECONNRESET", "EADDRINUSE", "ECONNREFUSED", "EPIPE", "ETIMEDOUT", "EACCES", "EMFILE", "ENOBUFS",
    "EAI_NONAME", "EAI_AGAIN",
)  # fmt: skip
FAULT_OPTIONS: Final = ("on", "times=", "nth=")


def offer_none(words: list[str], project: Project) -> Iterable[str]:
    return ()


def offer_words(*choices: str) -> NextWords:
    """Return a function that always offers the same words."""
    return lambda words, project: choices


def _offer(names: Callable[[Project], Iterable[str]], *then: str, is_last: bool = True) -> NextWords:
    """Return a function that offers project names, then the words `then`; if `is_last`, nothing follows."""

    def offer(words: list[str], project: Project) -> Iterable[str]:
        if len(words) == 1:
            return names(project)
        return then if len(words) == 2 or not is_last else ()

    return offer


def _instances(project: Project) -> Iterable[str]:
    return (instance.name for instance in project.instances)


def _framing_instances(project: Project) -> Iterable[str]:
    return (instance.name for instance in project.instances if block_row(instance.block).affix_pins)


after_instance_verb: Final = _offer(_instances)
after_doctor: Final = _offer(lambda project: (*_instances(project), *project.links()))
after_link: Final = _offer(lambda project: project.links(), "down", "up", is_last=False)
after_write: Final = _offer(lambda project: (data.name for data in project.data), "hex", is_last=False)
after_expect: Final = _offer(_instances, "STATUS=", "DONE=", "BUSY=", "ERROR=", "RCVD_LEN=", is_last=False)
after_mark: Final = _offer(_framing_instances, "hex", "text", "none")
after_framing: Final = _offer(
    lambda project: (*_framing_instances(project), *(buffer.name for buffer in project.combuffers)), "apply"
)
after_feed: Final = _offer(
    lambda project: (buffer.name for buffer in project.combuffers if can_be_fed(buffer)),
    *("hex", "text", "random", "file", "break"),
)


def after_set(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return (*_instances(project), *_entry_names(project), *KINDS)
    kind = words[1] if words[1] in KINDS else next(iter(find_kinds(words[1], project)), "")
    if words[1] in KINDS and len(words) == 2:
        return names_of(kind, project)
    name = words[2] if words[1] in KINDS else words[1]
    pins = [f"{pin}=" for pin in _input_names(name, project, bools_only=False)] if kind == "instance" else []
    declared = project.instance(name) if kind == "instance" else None
    keys = _missing_keys(kind, words, project, declared.block if declared else "") if kind else ()
    types = project.types.names() if kind == "data" else ()  # with `type=`, or alone
    keys = (*(f"type={name}" for name in types), *types, *keys)
    return (*pins, *(key for key in keys if not key.endswith(f"={NEW}")))  # only `add` takes `new`


def after_remove(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return (*_entry_names(project), *_instances(project), *KINDS)
    return names_of(words[1], project) if len(words) == 2 and words[1] in KINDS else ()


def _entry_names(project: Project) -> list[str]:
    return [
        name for kind in KINDS if kind not in ("instance", "certificate") for name in names_of(kind, project)
    ]


def _missing_keys(kind: str, words: list[str], project: Project, block: str) -> Iterable[str]:
    given = {word.partition("=")[0] for word in words}
    given |= command_keys_of(kind, project).bare
    fields = [field for field in fields_of(kind, project, block) if field.key not in given]
    return (*(f"{f.key}={choice}" for f in fields for choice in f.choices), *(f"{f.key}=" for f in fields))


def after_pulse(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return _instances(project)
    return _input_names(words[1], project, bools_only=True) if len(words) == 2 else ()


def after_peer(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return (peer.name for peer in project.peers)
    if len(words) == 2:
        return PEER_COMMANDS
    if words[2] == "play":
        return (sequence.name for sequence in project.sequences)
    if words[2:] == ["send", "message"]:
        return (message.name for message in project.messages)
    if words[2] != "send":
        return _PEER_WORDS.get(words[2], ()) if len(words) == 3 else ()
    if len(words) == 3:
        return (*SEND_MODES, "message")
    if len(words) == 4 and words[3] == "udt":
        return project.types.names()
    return SEND_OPTIONS


_PEER_WORDS: Final[dict[str, tuple[str, ...]]] = {
    "reply": ("on", "off"),
    "check": ("on", "off"),
    "try-splits": ("hex", "text", "udt", "stop"),
}


def after_fault(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return FAULT_CALLS
    if words[-1] == "on":
        return project.links()
    return (*FAULT_ERRORS, *FAULT_OPTIONS) if len(words) == 2 else FAULT_OPTIONS


def after_tap(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return (tap.name for tap in project.taps)
    if len(words) == 2:
        return "to-plc", "from-plc"
    if len(words) == 3:
        return "hold", "go", "drop", "insert", "edit", "delay", "split", "rst", "fin"
    return ("hex", "conversation") if words[3] in ("insert", "edit") else ("conversation",)


def after_trigger(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return (*_instances(project), *(data.name for data in project.data), "off")
    declared = project.instance(words[1])
    if len(words) > 2 or declared is None:
        return ("rises", "falls", "hold")
    pins = sorted(project.pins(declared.block), key=lambda pin: pin.name != "STATUS")
    return (f"{pin.name}{'' if pin.is_bool else '='}" for pin in pins)


def after_create(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return project.dialect.blocks
    if len(words) == 2:
        return (
            f"{words[1]}_{number}" for number in range(2, 100) if not project.instance(f"{words[1]}_{number}")
        )
    if words[1] not in project.dialect.blocks:
        return ()
    lines = project.combuffers if block_row(words[1]).buffer_pin else ()
    named = (
        ("connect", [each.name for each in project.connects]), ("data", [each.name for each in project.data]),
        ("task", [each.name for each in project.tasks]),
        ("config", [each.name for each in project.udp_configs]), ("addr", [a.name for a in project.addrs]),
        (block_row(words[1]).buffer_pin, [each.name for each in lines]),
        *((pin, [each.name for each in project.data]) for pin in block_row(words[1]).affix_pins),
    )  # fmt: skip
    given = {word.partition("=")[0] for word in words}
    pins = (f"{pin.name}=" for pin in project.pins(words[1]) if pin.direction != "out")
    links = (f"{key}={name}" for key, names in named if key not in given for name in names)
    return (*links, *pins)


def after_add(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return KINDS
    kind = words[1]
    if kind not in KINDS:
        return ()
    if len(words) == 2:
        return (propose_name(kind, project),)
    if kind == "data":
        return (*project.types.names(), *COMMON_TYPES) if len(words) == 3 else ("OF ",)
    if kind == "sequence":
        return (message.name for message in project.messages)
    if kind == "message":
        return (*SEND_MODES, "peer=") if len(words) == 3 else SEND_OPTIONS
    block = next((word.removeprefix("block=") for word in words if word.startswith("block=")), "")
    pins = (f"{pin.name}=" for pin in project.pins(block)) if block in project.dialect.blocks else ()
    return (*_missing_keys(kind, words, project, block), *pins)


def after_resize(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return (data.name for data in project.data)
    return (*project.types.names(), *COMMON_TYPES) if len(words) == 2 else ("OF ",)


def _input_names(instance: str, project: Project, bools_only: bool) -> Iterable[str]:
    declared = project.instance(instance)
    if declared is None:
        return ()
    pins = project.pins(declared.block)
    return (pin.name for pin in pins if pin.direction != "out" and (pin.is_bool or not bools_only))
