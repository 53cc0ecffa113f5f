"""A project file with more entries: what stood there stays, and it loads as the grown project."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trcvtui.errors import UserError
from trcvtui.net.connection.config import ConnectConfig
from trcvtui.project.edit import append_entry, read_entry
from trcvtui.project.file import read_project
from trcvtui.project.keys import keys_of, kind_name, names_of
from trcvtui.project.project import DataDecl, Declaration, MessageDecl, Project
from trcvtui.project.text import append_entries, relocate_files

PLAIN = """\
# A bench with words of its own.   Trailing blanks stay.  \n\
dialect   =   'baosky'  # in quotes of this kind

[[connect]]  # the first
  name = "C1"
LocalPort = 0x7D0
# of C1, still

# What stands above the instance is about the instance.
[[instance]]
name = "X"
block = 'TRCV_C'
connect = "C1"   # as above
"""
APART = PLAIN + '\n[[connect]]\nname = "C2"\n\n[[peer]]\nname = "P1"\nremote = "@C2"\n\n# The end.'
TEXTS = {
    "plain": PLAIN,
    "apart": APART,
    "a table after": PLAIN + '\n[sim]\nseed = 7\n',
    "scenario": PLAIN + '\n[scenario]\nsteps = """\n# not [[connect]]\nrun 1\n"""\n',
    "windows": PLAIN.replace("\n", "\r\n"),
    "no last line end": PLAIN.rstrip("\n"),
    "nothing but the dialect": 'dialect = "baosky"',
}  # fmt: skip


def load(text: str) -> Project:
    document = tomllib.loads(text)
    document.pop("scenario", None)
    return read_project(document, "b.toml", Path())


def parts(project: Project) -> dict[str, Any]:
    """Return what a project says; a variable by name, type and size."""
    said: dict[str, Any] = {name: getattr(project, name) for name in Project.__match_args__}
    said["data"] = [(d.name, d.type_name, d.size) for d in project.data]
    return said


def stays(old: str, new: str) -> bool:
    """Return whether every line of the old text stands in the new one, in its order."""
    lines = iter(new.splitlines(keepends=True))
    return all(any(line == other for other in lines) for line in old.splitlines(keepends=True))


texts = st.text(st.characters(min_codepoint=32, max_codepoint=0x2FFF, exclude_categories=["Cs"]), min_size=1)


@st.composite
def additions(draw: st.DrawFn, project: Project) -> list[Declaration]:
    added: list[Declaration] = []
    for number in range(draw(st.integers(1, 6))):
        connects = names_of("connect", project) or ("",)
        kind = draw(st.sampled_from(["connect", "data", "instance", "peer", "message", "addr"]))
        port = draw(st.integers(0, 65535))
        every: dict[str, dict[str, Any]] = {
            "connect": {
                "ActiveEstablished": draw(st.booleans()),
                "LocalPort": port,
                "history": f"{64 + port % 65_000}KiB",
            },
            "data": {"type": draw(st.sampled_from(["INT", "ARRAY[0..9] OF BYTE", "STRING[20]"]))},
            "instance": {"block": "TRCV_C", "connect": draw(st.sampled_from(connects)), "LEN": port},
            "peer": {
                "active": True,
                "remote": f"127.0.0.1:{port}",
                "says": draw(st.lists(texts, max_size=2)),
            },
            "message": {"text": draw(texts)},
            "addr": {"RemoteAddress": "10.0.0.7", "RemotePort": port},
        }
        content = every[kind]
        if content.get("connect") == "":
            continue
        decl = read_entry(kind, {"name": f"N{number}", **content}, project, "w")
        added.append(decl)
        project = append_entry(project, decl)
    return added


@given(st.data(), st.sampled_from(sorted(TEXTS)))
def test_whatever_is_added_loads_again_and_the_text_before_stays(data: st.DataObject, name: str) -> None:
    text = TEXTS[name]
    project = load(text)
    added = data.draw(additions(project))
    new = append_entries(text, added, "b.toml")
    for decl in added:
        project = append_entry(project, decl)
    assert parts(load(new)) == parts(project)
    assert stays(text if text.endswith("\n") else text + "\n", new)
    assert ("\r\n" in new) == (name == "windows")
    assert "\n" not in new.replace("\r\n", "") or name != "windows"


@given(st.data())
def test_the_keys_of_an_entry_are_read_as_that_entry_again(data: st.DataObject) -> None:
    project = load(PLAIN)
    for decl in data.draw(additions(project)):
        again = read_entry(kind_name(decl), {"name": decl.name, **dict(keys_of(decl))}, project, "w")
        if isinstance(decl, DataDecl) and isinstance(again, DataDecl):
            assert (again.name, again.type_name, again.size) == (decl.name, decl.type_name, decl.size)
        else:
            assert again == decl
        project = append_entry(project, decl)


def test_an_entry_comes_after_the_last_of_its_kind_and_comments_stay_where_they_belong() -> None:
    new = append_entries(PLAIN, [ConnectConfig("C7", active=True)], "b.toml")
    assert new == PLAIN.replace(
        "# of C1, still\n", '# of C1, still\n\n[[connect]]\nname = "C7"\nActiveEstablished = true\n'
    )


def test_what_a_message_says_is_quoted_so_that_it_can_be_read() -> None:
    new = append_entries(
        PLAIN, [MessageDecl("hello", 'text "it\'s"'), MessageDecl("bye", 'text "bye"')], "b.toml"
    )
    assert 'text = "text \\"it\'s\\""\n' in new
    assert "text = 'text \"bye\"'\n" in new


def test_a_list_of_inline_tables_is_no_place_for_a_new_one() -> None:
    text = 'dialect = "baosky"\nconnect = [{name = "C1"}]\n'
    with pytest.raises(UserError, match="a form that cannot be extended"):
        append_entries(text, [ConnectConfig("C2")], "b.toml")


def test_the_file_of_a_udt_is_named_as_the_new_folder_sees_it(tmp_path: Path) -> None:
    text = 'dialect = "baosky"\n[[udt]]\nfile = "types/a.st"  # ours\n'
    new = relocate_files(text, tmp_path, tmp_path / "saved", "b.toml")
    assert new == text.replace("types/a.st", "../types/a.st")
    assert relocate_files(text, tmp_path, tmp_path, "b.toml") == text
