"""`--set PATH=VALUE`: checked like what stands in the file, but named by its path."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests import golden
from trcvtui.errors import UserError
from trcvtui.project.file import load_project, read_project
from trcvtui.project.project import Project

DOCUMENT: dict[str, Any] = {
    "dialect": "baosky",
    "options": {"retry": "T#1s"},
    "data": [{"name": "rx", "type": "INT"}],
    "connect": [{"name": "C1", "LocalPort": 1}],
    "instance": [{"name": "X", "block": "TRCV_C", "connect": "C1", "LEN": 1}],
    "peer": [{"name": "P", "active": True, "remote": "@C1"}],
}


def read(*overrides: str) -> Project:
    return read_project(DOCUMENT, "b.toml", Path("."), overrides)


@pytest.mark.parametrize(
    ("override", "look", "value"),
    [
        ("connect.C1.LocalPort=2000", lambda p: p.connects[0].local.port, 2000),
        ("connect.C1.LocalPort=16#10", lambda p: p.connects[0].local.port, 16),
        ("connect.C1.RemotePort=@P", lambda p: p.connects[0].remote_port, "@P"),
        ("connect.C1.RemotePort=5", lambda p: p.connects[0].remote_port, 5),
        ("connect.C1.LocalAddress=127.0.0.1", lambda p: p.connects[0].local.address, "127.0.0.1"),
        ("connect.C1.ActiveEstablished=TRUE", lambda p: p.connects[0].active, True),
        ("options.retry=T#100ms", lambda p: p.options["retry"], 100_000_000),
        ("options.com_rst_autoclear=0", lambda p: p.options["com_rst_autoclear"], False),
        ("options.max_len=65536", lambda p: p.rules.max_len, 65536),
        ("instance.X.LEN=4", lambda p: p.instances[0].inputs, (("LEN", 4),)),
        ("instance.X.ADHOC=1", lambda p: p.instances[0].inputs, (("LEN", 1), ("ADHOC", True))),
        ("instance.X.data=rx", lambda p: p.instances[0].data, "rx"),
        ("data.rx.type=ARRAY[0..9] OF BYTE", lambda p: p.data[0].size, 10),
        ("peer.P.remote=127.0.0.1:7", lambda p: p.peers[0].end.port, 7),
        ("task.MAIN.interval=T#1ms", lambda p: p.tasks[0].interval_ns, 1_000_000),
        ("model=T3", lambda p: p.connection_limit, 8),
        ("start=set X CONT=1", lambda p: p.start, "set X CONT=1"),
        ("sim.seed=7", lambda p: p.sim.seed, 7),
        ("sim.addresses=10.0.0.1,10.0.0.2", lambda p: p.sim.addresses, ("10.0.0.1", "10.0.0.2")),
    ],
)
def test_a_value_is_set(override: str, look: Any, value: Any) -> None:
    assert look(read(override)) == value


def test_the_last_of_two_wins_and_the_document_stays_as_it_was() -> None:
    assert read("connect.C1.LocalPort=2", "connect.C1.LocalPort=3").connects[0].local.port == 3
    assert DOCUMENT["connect"][0]["LocalPort"] == 1
    assert read().options["retry"] == 1_000_000_000


@pytest.mark.parametrize("table", ["", "[options]\n", '[[connect]]\nname = "C1"\n'])
def test_a_key_nested_a_hundred_deep_is_a_mistake_like_any_other(table: str, tmp_path: Path) -> None:
    file = tmp_path / "deep.toml"
    file.write_text(f'dialect = "baosky"\n{table}{"a." * 100}a = 1\n')
    with pytest.raises(UserError) as caught:
        load_project(file, ["connect.C1.LocalPort=1"])
    assert any("a: found an unknown" in line for line in caught.value.lines())


def test_a_mistake_is_named_by_its_path() -> None:
    golden.mistakes("--set", lambda override: read(override).path)
