"""Completion of bench command lines: what may stand next, from tables and from the names of the project."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from textual.suggester import Suggester

from trcvtui.plc.snapshot import block_row
from trcvtui.project.edit import kinds_named
from trcvtui.project.keys import OFFERED as KINDS
from trcvtui.project.keys import names_of
from trcvtui.project.project import Project
from trcvtui.rig.commands.peer import VERBS as PEER_VERBS
from trcvtui.tui.forms.fields import fields_of, first_name, keys_of_line

PEER_COMMANDS: Final = ("send", *sorted(set(PEER_VERBS) - {"send"}))
VERBS: Final = (
    "set", "pulse", "peer", "write", "fault", "link", "plc", "run", "hold", "go", "trigger", "expect",
    "scenarios", "race", "export timing", "find", "create", "delete", "download", "resize", "mark",
    "save scenario", "add", "remove", "undo", "save project", "lab", "udt", "feed", "prefix", "suffix",
    "framing",
)  # fmt: skip
TYPES: Final = ("ARRAY[0..", "BYTE", "WORD", "DWORD", "INT", "DINT", "REAL", "LREAL", "STRING[")
SEND_MODES: Final = ("hex", "text", "udt", "file", "random")
SEND_OPTIONS: Final = ("split=", "gap=T#", "repeat=", "every=T#")
CALLS: Final = (
    "recv", "connect", "bind", "listen", "accept", "socket", "send", "shutdown", "close", "set_reuse",
    "poll_add", "poll_del", "abort", "resolve", "buffer", "queue", "clear",
)  # fmt: skip
ERRORS: Final = (
    "ECONNRESET", "EADDRINUSE", "ECONNREFUSED", "EPIPE", "ETIMEDOUT", "EACCES", "EMFILE", "ENOBUFS",
    "EAI_NONAME", "EAI_AGAIN",
)  # fmt: skip
FAULT_OPTIONS: Final = ("on", "times=", "nth=")


def complete(line: str, project: Project) -> str | None:
    """Return the line with its last word completed, None where nothing begins like that."""
    *words, last = line.split(" ")
    if not words and not last:
        return None
    for candidate in _next(words, project):
        if candidate.startswith(last) and candidate != last:
            return line[: len(line) - len(last)] + candidate
    return None


def _next(words: list[str], project: Project) -> Iterable[str]:
    if not words:
        return VERBS
    candidates = _AFTER.get(words[0])
    return candidates(words, project) if candidates else ()


def _after_set(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return (*_instances(project), *_parts(project), *KINDS)
    kind = words[1] if words[1] in KINDS else next(iter(kinds_named(words[1], project)), "")
    if words[1] in KINDS and len(words) == 2:
        return names_of(kind, project)
    name = words[2] if words[1] in KINDS else words[1]
    pins = [f"{pin}=" for pin in _inputs(name, project, bools_only=False)] if kind == "instance" else []
    return (*pins, *_keys_of(kind, words, project)) if kind else ()


def _after_remove(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return (*_parts(project), *_instances(project), *KINDS)
    return names_of(words[1], project) if len(words) == 2 and words[1] in KINDS else ()


def _parts(project: Project) -> list[str]:
    return [
        name for kind in KINDS if kind not in ("instance", "certificate") for name in names_of(kind, project)
    ]


def _keys_of(kind: str, words: list[str], project: Project) -> Iterable[str]:
    given = {word.partition("=")[0] for word in words}
    given |= keys_of_line(kind, project).bare
    fields = [field for field in fields_of(kind, project) if field.key not in given]
    return (*(f"{f.key}={choice}" for f in fields for choice in f.choices), *(f"{f.key}=" for f in fields))


def _after_pulse(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return _instances(project)
    return _inputs(words[1], project, bools_only=True) if len(words) == 2 else ()


def _after_peer(words: list[str], project: Project) -> Iterable[str]:
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
        return (data.type_name for data in project.data)
    return SEND_OPTIONS


_PEER_WORDS: Final[dict[str, tuple[str, ...]]] = {
    "reply": ("on", "off"),
    "check": ("on", "off"),
    "try-splits": ("hex", "text", "udt", "stop"),
}


def _after_fault(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return CALLS
    if words[-1] == "on":
        return project.links()
    return (*ERRORS, *FAULT_OPTIONS) if len(words) == 2 else FAULT_OPTIONS


def _after_feed(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return [
            buffer.name
            for buffer in project.combuffers
            if buffer.source in ("sim", "serial") and not buffer.line
        ]
    return ("hex", "text", "random", "file", "break") if len(words) == 2 else ()


def _after_mark(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return [instance.name for instance in project.instances if block_row(instance.block).marks]
    return ("hex", "text", "none") if len(words) == 2 else ()


def _after_framing(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        readers = [i.name for i in project.instances if block_row(i.block).marks]
        return (*readers, *(buffer.name for buffer in project.combuffers))
    return ("apply",) if len(words) == 2 else ()


def _after_link(words: list[str], project: Project) -> Iterable[str]:
    return project.links() if len(words) == 1 else ("down", "up")


def _after_write(words: list[str], project: Project) -> Iterable[str]:
    return (data.name for data in project.data) if len(words) == 1 else ("hex",)


def _after_expect(words: list[str], project: Project) -> Iterable[str]:
    return _instances(project) if len(words) == 1 else ("STATUS=", "DONE=", "BUSY=", "ERROR=", "RCVD_LEN=")


def _after_trigger(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return (*_instances(project), *(data.name for data in project.data), "off")
    declared = project.instance(words[1])
    if len(words) > 2 or declared is None:
        return ("rises", "falls", "hold")
    pins = sorted(project.pins(declared.block), key=lambda pin: pin.name != "STATUS")
    return (f"{pin.name}{'' if pin.is_bool else '='}" for pin in pins)


def _after_create(words: list[str], project: Project) -> Iterable[str]:
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
        *((pin, [each.name for each in project.data]) for pin in block_row(words[1]).marks),
    )  # fmt: skip
    given = {word.partition("=")[0] for word in words}
    pins = (f"{pin.name}=" for pin in project.pins(words[1]) if pin.direction != "out")
    links = (f"{key}={name}" for key, names in named if key not in given for name in names)
    return (*links, *pins)


def _after_add(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return KINDS
    kind = words[1]
    if kind not in KINDS:
        return ()
    if len(words) == 2:
        return (first_name(kind, project),)
    if kind == "data":
        return (*project.types.names(), *TYPES) if len(words) == 3 else ("OF ",)
    if kind == "sequence":
        return (message.name for message in project.messages)
    if kind == "message":
        return (*SEND_MODES, "peer=") if len(words) == 3 else SEND_OPTIONS
    block = next((word.removeprefix("block=") for word in words if word.startswith("block=")), "")
    pins = (f"{pin.name}=" for pin in project.pins(block)) if block in project.dialect.blocks else ()
    return (*_keys_of(kind, words, project), *pins)


def _after_resize(words: list[str], project: Project) -> Iterable[str]:
    if len(words) == 1:
        return (data.name for data in project.data)
    return (*project.types.names(), *TYPES) if len(words) == 2 else ("OF ",)


def _after_udt(words: list[str], project: Project) -> Iterable[str]:
    from trcvtui.tui.lab.lab import PROFILE_WORDS, SOURCES  # read when first asked for
    from trcvtui.tui.lab.lab_lines import WORDS
    from trcvtui.udt.sources import type_files_in

    if len(words) == 1:
        return WORDS
    if words[1] == "open":
        return type_files_in(project.base) if len(words) == 2 else ()
    known = {"type": project.types.names(), "bytes": SOURCES, "ours": PROFILE_WORDS, "theirs": PROFILE_WORDS}
    return known.get(words[1], ())


def _instances(project: Project) -> Iterable[str]:
    return (instance.name for instance in project.instances)


def _inputs(instance: str, project: Project, bools_only: bool) -> Iterable[str]:
    declared = project.instance(instance)
    if declared is None:
        return ()
    pins = project.pins(declared.block)
    return (pin.name for pin in pins if pin.direction != "out" and (pin.is_bool or not bools_only))


_AFTER: Final[dict[str, Callable[[list[str], Project], Iterable[str]]]] = {
    "set": _after_set,
    "pulse": _after_pulse,
    "peer": _after_peer,
    "fault": _after_fault,
    "link": _after_link,
    "feed": _after_feed,
    "framing": _after_framing,
    "prefix": _after_mark,
    "suffix": _after_mark,
    "write": _after_write,
    "expect": _after_expect,
    "trigger": _after_trigger,
    "create": _after_create,
    "delete": lambda words, project: _instances(project) if len(words) == 1 else (),
    "download": lambda words, project: _instances(project) if len(words) == 1 else (),
    "resize": _after_resize,
    "add": _after_add,
    "remove": _after_remove,
    "udt": _after_udt,
    "save": lambda words, project: ("scenario", "project") if len(words) == 1 else (),
    "plc": lambda words, project: ("stop", "run"),
}


class BenchSuggester(Suggester):
    """Offers the completed line to an input field."""

    def __init__(self, project: Callable[[], Project]) -> None:
        super().__init__(use_cache=False, case_sensitive=True)
        self._project = project

    async def get_suggestion(self, value: str) -> str | None:
        """Return the completed line."""
        return complete(value, self._project())
