"""A filter of messages: the condition of a trigger, asked of rows."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path

import pytest

from tests import golden
from tests.bench.bench_project import bench_project
from trcvtui.engine.message_filter import read_filter, read_layout_filter
from trcvtui.history.messages import MessageRow
from trcvtui.project.project import Project
from trcvtui.udt.layout.values import encode


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return bench_project(tmp_path)


def row_of(project: Project, values: dict[str, object], name: str = "rx") -> MessageRow:
    decl = project.data_decl(name)
    assert decl is not None
    content = encode(decl.layout, values)
    return MessageRow(1, 9, 0, None, len(content), 0x7008, "C1", 0, "", len(content), content)


@pytest.mark.parametrize(
    ("condition", "is_let_through"),
    [
        ("speed > 50.0", True), ("speed > 50.5", False), ("SPEED=50.5", True), ("rx.speed>=50.5", True),
        ("X.speed < 51", True), ("X rx.speed < 51", True), ("data.speed != 50.5", False),
        ("mode = On", True), ("name = 'a=b'", True), ("name != 'a=b'", False), ("flag = TRUE", True),
        ("t > T#999ms", True), ("m[2, 0] < 0", True), ("pts[1].y <= -3", True), ("w = 16#FF", True),
        ("STATUS=7008", True), ("X STATUS = 7008", True), ("status != 7008", False), ("DONE=1", True),
        ("RCVD_LEN=52", True), ("length != 52", False), ("RCVD_LEN > 51", True),
    ],
)  # fmt: skip
def test_a_name_without_an_instance_is_its_member_or_pin(
    condition: str, is_let_through: bool, project: Project
) -> None:
    values = {"speed": 50.5, "flag": True, "mode": 7, "t": "T#1s", "name": "a=b", "m[2,0]": -1, "w": 255}
    row = row_of(project, {**values, "pts[1].y": -3})
    assert read_filter(condition, project, "X")(row) is is_let_through
    layout = project.data_decl("rx").layout  # type: ignore[union-attr]
    is_of_x = condition.startswith(("X", "rx", "STATUS", "DONE"))
    if not is_of_x and "status" not in condition:
        assert read_layout_filter(condition, layout)(row) is is_let_through, "without a project, too"


@pytest.mark.parametrize("condition", ["speed = 0", "speed != 1", "w = 0", "w != 1"])
def test_what_a_row_does_not_know_makes_no_condition_true(condition: str, project: Project) -> None:
    lets_through, row = read_filter(condition, project, "X"), row_of(project, {})
    assert lets_through(row) is (condition[-1] in "01")
    for less in (
        row._replace(content=None), row._replace(content=b""), row._replace(content=row.content[:6]),  # type: ignore[index]
        row._replace(have=6), row._replace(have=0),
    ):  # fmt: skip
        assert not lets_through(less), "bytes are gone, are too few, or stand behind a hole"


@pytest.mark.parametrize(
    ("condition", "speeds"),
    [("speed = NaN", [nan]), ("speed != NaN", [inf, 0.0]), ("speed < NaN", []), ("speed=Infinity", [inf])],
)
def test_a_nan_is_found_by_its_name(condition: str, speeds: list[float], project: Project) -> None:
    lets_through = read_filter(condition, project, "X")
    assert repr([x for x in (nan, inf, 0.0) if lets_through(row_of(project, {"speed": x}))]) == repr(speeds)


@pytest.mark.parametrize("condition", ["STATUS=7006", "STATUS!=7006"])
def test_a_status_that_is_not_known_is_neither_equal_nor_unequal(condition: str, project: Project) -> None:
    assert not read_filter(condition, project, "X")(row_of(project, {})._replace(status=-1))


def test_a_type_that_is_one_value_is_named_by_its_variable_or_its_type(project: Project) -> None:
    layout = project.data_decl("n").layout  # type: ignore[union-attr]
    for condition in ("n > 6", "data=7"):
        assert read_layout_filter(condition, layout)(row_of(project, {"": 7}, "n"))


def test_what_is_no_filter_is_refused_with_the_nearest_name(project: Project) -> None:
    golden.mistakes("filters", lambda text: read_filter(text, project, "X"))
    golden.mistakes("filters of a type", lambda text: read_layout_filter(text, project.data[0].layout))
