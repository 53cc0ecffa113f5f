"""Parts of a project as the fields of a form, and the `add` or `set` line that the fields make."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from msgspec.structs import replace

from trcvtui.plc.snapshot import block_row
from trcvtui.project.edit import FormRow, changeable_keys, command_keys_of, fields_of, find_entry
from trcvtui.project.key_rows import KeyValue
from trcvtui.project.keys import BOOLS, EDITED, OFFERED_KINDS, TABLES, entries_of
from trcvtui.project.project import InstanceDecl, Project
from trcvtui.project.proposals import NEW
from trcvtui.tui.view_model.view_model import ViewModel

KIND_TITLES: Final = {kind: TABLES[kind].title for kind in OFFERED_KINDS}
BENCH_KEYS: Final = frozenset(("LocalAddress", "ListenPort"))  # of the bench, not of a structure


def kinds_of(project: Project) -> tuple[str, ...]:
    """Return the kinds of parts that you can add. A ComBuffer needs a dialect with ComBuffer blocks."""
    has_buffers = any(block_row(block).buffer_pin for block in project.dialect.blocks)
    return OFFERED_KINDS if has_buffers else tuple(kind for kind in OFFERED_KINDS if kind != "combuffer")


def make_add(kind: str, name: str, texts: Mapping[str, str], project: Project) -> str:
    """Return the `add` line; an empty field adds no key."""
    from trcvtui.udt.literals import quote_text  # read when first asked for

    bare, may_have_blanks = command_keys_of(kind, project)
    words = ["add", kind, name.strip()]
    for key, text in texts.items():
        value = text.strip()
        if value:
            shown = quote_text(value) if key in may_have_blanks else value
            words.append(shown if key in bare else f"{key}={shown}")
    return " ".join(words)


class ProjectPart(NamedTuple):
    kind: str
    name: str

    def __str__(self) -> str:
        """Return the title of the part on the screen: `CONNECT C1`."""
        return f"{TABLES[self.kind].what} {self.name}"


def list_parts(view_model: ViewModel, peer_first: bool) -> list[ProjectPart]:
    """Return the parts of the selected instance and the selected peer. Often changed kinds come first."""
    instance = view_model.project.instance(view_model.selected)
    own = list(_parts_of(instance)) if instance is not None else []
    peer = view_model.peer_snapshot
    talks = [ProjectPart("peer", peer.name), ProjectPart("connect", peer.link)] if peer is not None else []
    found = dict.fromkeys([*talks, *own] if peer_first else [*own, *talks])
    return [part for part in found if find_entry(*part, view_model.project) is not None]


def _parts_of(instance: InstanceDecl) -> Iterator[ProjectPart]:
    is_buffered = block_row(instance.block).has_com_buffer
    link = "combuffer" if is_buffered else "udp_config" if instance.on_config else "connect"
    yield ProjectPart(link, instance.connect)
    if instance.addr:
        yield ProjectPart("addr", instance.addr)
    for data in (instance.data, *instance.pointers):
        if data:
            yield ProjectPart("data", data)
    yield ProjectPart("instance", instance.name)


def all_parts(project: Project) -> list[ProjectPart]:
    return [ProjectPart(kind, each.name) for kind in EDITED for each in entries_of(kind, project)]


def values_of(part: ProjectPart, project: Project) -> dict[str, KeyValue]:
    decl = find_entry(*part, project)
    return changeable_keys(decl, project) if decl is not None else {}


def format_value(value: KeyValue) -> str:
    if isinstance(value, list):
        return " ".join(value)
    return str(value).lower() if isinstance(value, bool) else str(value)


def fields_to_change(
    part: ProjectPart, now: Mapping[str, KeyValue], project: Project, block: str
) -> list[FormRow]:
    """Return the fields of a part. A missing key's field is empty. `block` decides an instance's fields.

    A key with several texts, such as `replies`, has no field. Only a `set` line changes such a key.
    """
    known = [_without_new(each) for each in fields_of(part.kind, project, block, to_change=True)]
    bare = command_keys_of(part.kind, project).bare
    if part.kind != "instance":
        keys = {each.key for each in known}
        known += [FormRow(key, "", BOOLS * isinstance(now[key], bool)) for key in now if key not in keys]
    away = {
        key for key, value in now.items() if isinstance(value, list) and len(value) > 1 and key not in bare
    }
    if part.kind == "connect":
        away.add("type")  # the structure cannot change
    elif part.kind == "instance":
        away.add("inputs")
    if part.kind in ("connect", "addr") and project.dialect.describes_connects and now:
        away |= {each.key for each in known} - now.keys() - BENCH_KEYS  # fields of other structures
    other = part.kind == "instance" and block != now.get("block")  # then missing keys get a proposal
    first = {each.key: each.first if other else "" for each in known}
    first |= {key: format_value(value) for key, value in now.items()}
    kept = [each for each in known if each.key not in away]
    return [replace(each, first=block if each.key == "block" else first[each.key]) for each in kept]


def _without_new(field: FormRow) -> FormRow:
    """Return the field without the choice NEW: an existing part can only refer to existing parts."""
    there = tuple([each for each in field.choices if each != NEW])
    return replace(field, choices=there, first=field.first if field.first != NEW else "".join(there[-1:]))


def make_set_line(
    part: ProjectPart, now: Mapping[str, KeyValue], texts: Mapping[str, str], project: Project
) -> str:
    """Return the `set` line that gives each changed key its field's text, or "" if no key has changed."""
    gone: dict[str, str] = {}
    if part.kind == "instance" and texts["block"] in project.dialect.blocks:
        pins = {pin.name for pin in project.pins(texts["block"])}
        gone = {key: "" for key in now if key not in pins}
    after = {key: text.strip() for key, text in (gone | dict(texts)).items()}
    changed = {key: text for key, text in after.items() if text != format_value(now.get(key, ""))}
    if not changed:
        return ""
    words = [f"set {part.kind} {part.name}"]
    if part.kind == "message":  # its text is the end of the line
        words += [f"peer={changed['peer']}"] if "peer" in changed else []
        return " ".join([*words, after["text"]])
    from trcvtui.udt.literals import quote_text  # read when first asked for

    bare, may_have_blanks = command_keys_of(part.kind, project)
    words += [changed.pop(key) for key in bare & changed.keys()]
    for key, text in changed.items():
        is_quoted = text and (key in may_have_blanks or " " in text)
        words.append(f"{key}={quote_text(text) if is_quoted else text}")
    return " ".join(words)
