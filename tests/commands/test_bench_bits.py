"""One bit of a byte in bench commands: it is expected and compared, but not written over its neighbours."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from tests.bench.bench_project import bench_project
from trcvtui.commands.table import parse_line
from trcvtui.commands.words import Expect, MemberIs
from trcvtui.errors import UserError
from trcvtui.project.project import Project
from trcvtui.udt.layout.layout import lay_out, rules_for
from trcvtui.udt.types import ELEMENTARY, Member, Struct

FLAGS = Struct("Flags", tuple(Member(name, ELEMENTARY["BOOL"]) for name in ("ready", "fault")))


@pytest.fixture
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    found = bench_project(tmp_path_factory.mktemp("bits"))
    layout = lay_out(FLAGS, rules_for("s7-standard"))
    data = tuple(replace(decl, layout=layout) if decl.name == "rx" else decl for decl in found.data)
    return replace(found, data=data)


def test_a_bit_is_not_written_alone(project: Project) -> None:
    with pytest.raises(UserError) as refused:
        parse_line("write rx.fault TRUE", project, "w")
    expected = "w: found 'fault', bit 1 of byte 0, expected the whole byte, such as: write rx+0 hex 01"
    assert refused.value.lines() == [expected]


def test_a_bit_is_expected_by_its_own_value(project: Project) -> None:
    expected = Expect(MemberIs("rx", "fault", True), within_ns=None)
    assert parse_line("expect rx.fault TRUE", project, "w") == expected
