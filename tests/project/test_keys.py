"""A key is one row: it is read, judged, written, asked for in the form, completed and told on its page."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from msgspec.structs import replace

from tests.docs_scripts import script
from tests.engine.test_project_save import driven, say
from tests.properties.drawn_projects import projects
from trcvtui.dialects.dialect import format_value
from trcvtui.errors import UserError
from trcvtui.net.connection.config import UdpConfig
from trcvtui.project.edit import diff_projects, fields_of
from trcvtui.project.file import load_project, read_project
from trcvtui.project.key_rows import Hint, Key, offer_fixed
from trcvtui.project.keys import (
    DESCRIBED_TABLES,
    EDITED,
    OFFERED_KINDS,
    SIM_ROW,
    TABLES,
    entries_of,
    entry_of,
)
from trcvtui.project.project import Project
from trcvtui.project.tables import text_kind
from trcvtui.tui.completion import complete

ROOT = Path(__file__).parents[2]
CONFIGS = sorted(
    file
    for file in (ROOT / "configs").rglob("*.toml")
    if file.parent.name != "tls" and not re.search(r"^project\s*=", file.read_text("utf-8"), re.M)
)[::36]  # with a project of its own, not that of another folder
WORDS = ("short", "long")


class NotedUdpConfig(UdpConfig, frozen=True):
    """A UDP_CONFIG with a note."""

    note: str = ""


NOTE = Key(
    "note",
    text_kind(" or ".join(WORDS), lambda text: text if text in WORDS else None),
    "How long a talk is expected.",
    "note",
    "",
    Hint("how long a talk is expected", offer_fixed(*WORDS)),
)


make_keys = script("make_keys")


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Add the key in one place; return a project with it."""
    row = TABLES["udp_config"]
    noted = replace(row, makes=NotedUdpConfig, keys=(*row.keys, NOTE))
    monkeypatch.setitem(TABLES, "udp_config", noted)
    path = tmp_path / "b.toml"
    path.write_text('dialect = "baosky"\n[[udp_config]]\nname = "U1"\nnote = "short"\n', encoding="utf-8")
    return path


def notes(path: Path) -> list[Any]:
    return [getattr(config, "note", None) for config in load_project(path).udp_configs]


def test_a_made_up_key_is_read_set_from_outside_and_judged(file: Path) -> None:
    assert notes(file) == ["short"]
    assert getattr(load_project(file, ["udp_config.U1.note=long"]).udp_configs[0], "note", None) == "long"
    with pytest.raises(UserError) as caught:
        load_project(file, ["udp_config.U1.note=huge"])
    (problem,) = caught.value.problems
    assert (problem.found, problem.expected) == ("'huge'", "short or long")


def test_a_made_up_key_is_added_changed_and_saved(file: Path) -> None:
    for driver in driven(file):
        for line in ("add udp_config U2 note=long", "set U1 note=long", "save project"):
            assert say(driver, line).answers[-1].error == ""
    assert notes(file) == ["long", "long"]
    assert file.read_text().count('note = "long"') == 2


def test_a_made_up_key_left_at_its_default_is_not_written(file: Path) -> None:
    decl = NotedUdpConfig("U1")
    assert "note" not in dict(entry_of(decl))


def test_a_made_up_key_stands_in_the_form_and_is_completed(file: Path) -> None:
    project = load_project(file)
    field = next(field for field in fields_of("udp_config", project) if field.key == "note")
    assert (field.hint, field.choices) == ("how long a talk is expected", WORDS)
    assert complete("add udp_config U2 no", project) == "add udp_config U2 note=short"
    assert complete("set U1 no", project) == "set U1 note=short"


def test_a_made_up_key_stands_on_the_page(file: Path) -> None:
    assert "| `note` | How long a talk is expected. | short or long |" in make_keys.page()


def test_the_page_is_what_the_rows_say() -> None:
    is_in_step = (ROOT / "docs" / "project-file.md").read_text(encoding="utf-8") == make_keys.page()
    assert is_in_step, "docs/project-file.md is out of step with trcvtui/project/keys.py: run `make atlas`"


def test_every_row_says_what_it_is_for_and_where_its_value_goes() -> None:
    for row in (*TABLES.values(), *DESCRIBED_TABLES.values(), SIM_ROW):
        assert row.help.endswith("."), row.kind
        names = set(getattr(row.makes, "__match_args__", ())) or None
        for key in row.keys:
            assert key.help, f"{row.kind}.{key.name}"
            if key.of and names is not None:
                assert key.of.partition(".")[0] in names, f"{row.kind}.{key.name}"
    assert set(EDITED) == set(OFFERED_KINDS) == set(TABLES) - {"task"}


# -- read, written, read --------------------------------------------------------------------------------


def written(project: Project) -> dict[str, Any]:
    switches = {switch.name: switch for switch in project.dialect.switches}
    return {
        "dialect": project.dialect.name,
        "model": project.model,
        "options": {name: format_value(switches[name], value) for name, value in project.options.items()},
        "start": project.start,
        "program": project.program,
        "constants": dict(project.constants),
        "sim": dict(SIM_ROW.toml_keys(project.sim)),
        **{kind: [dict(entry_of(decl)) for decl in entries_of(kind, project)] for kind in TABLES},
    }


def assert_comes_back(project: Project, name_of_file: Path, base: Path) -> None:
    again = read_project(written(project), "again.toml", base)
    assert diff_projects(project, again) == (), name_of_file
    for name in ("tasks", "options", "rules", "model", "sim", "start", "program", "constants"):
        assert getattr(again, name) == getattr(project, name), (name_of_file, name)


def test_each_project_of_the_configs_that_is_written_is_read_as_it_was() -> None:
    for path in CONFIGS:
        assert_comes_back(load_project(path), path, path.parent)


@given(projects())
def test_a_drawn_project_that_is_written_is_read_as_it_was(document: dict[str, Any]) -> None:
    assert_comes_back(read_project(document, "drawn.toml", Path()), Path("drawn.toml"), Path())
