"""A project file becomes frozen values: what stands in it, and what is in force when nothing does."""

from __future__ import annotations

import pickle
import tomllib
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests import golden
from trcvtui.dialects import DIALECTS
from trcvtui.errors import UserError
from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.results import Endpoint
from trcvtui.project.file import load_project, load_scenario_document, read_project
from trcvtui.project.project import InstanceDecl, PeerDecl, Project, SimDecl, Task

CONTRACT = """
dialect = "baosky"
model   = "T4"
[options]
not_connected = "hold"
[[task]]
name = "MAIN"
interval = "T#20ms"
priority = 2
[[udt]]
file = "telegram.st"
[[data]]
name = "rx"
type = "Telegram"
[[connect]]
name = "C1"
ActiveEstablished = false
LocalAddress = "127.0.0.1"
LocalPort = 2000
RemoteAddress = "127.0.0.1"
RemotePort = 0
SendDelayOpt = true
KeepAliveTimeInterval = 3
[[instance]]
name = "TRCV_C_1"
block = "TRCV_C"
connect = "C1"
data = "rx"
task = "MAIN"
LEN = 4
ADHOC = false
[[peer]]
name = "P1"
active = true
remote = "127.0.0.1:2000"
"""
SMALLEST = 'dialect = "baosky"\n[[connect]]\nname = "C1"\n'
ONE_INSTANCE = SMALLEST + '[[instance]]\nname = "X"\nblock = "TRCV_C"\nconnect = "C1"\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "telegram.st").write_text("TYPE Telegram : STRUCT id : DINT; c : CHAR; END_STRUCT END_TYPE")
    return tmp_path


def read(text: str, base: Path = Path("."), overrides: Sequence[str] = ()) -> Project:
    return read_project(tomllib.loads(text), "bench.toml", base, overrides)


def test_every_key_of_the_contract_is_read(folder: Path) -> None:
    project = read(CONTRACT, folder)

    assert (project.dialect.name, project.model, project.connection_limit) == ("baosky", "T4", 32)
    assert project.options["not_connected"] == "hold"
    assert project.rules.not_connected.value == "hold"
    assert project.tasks == (Task("MAIN", 20_000_000, 2),)
    assert project.connects == (
        ConnectConfig("C1", False, Endpoint("127.0.0.1", 2000), "127.0.0.1", 0, True, 3),
    )
    inputs = (("LEN", 4), ("ADHOC", False))
    assert project.instances == (InstanceDecl("TRCV_C_1", "TRCV_C", "C1", "rx", "MAIN", inputs),)
    assert project.peers == (PeerDecl("P1", True, Endpoint("127.0.0.1", 2000)),)


def test_what_is_left_out_is_what_the_record_holds_at_first() -> None:
    project = read(ONE_INSTANCE)

    assert (project.model, project.connection_limit) == ("T4", 32)
    assert project.tasks == (Task("MAIN", 10_000_000, 1),)
    assert project.connects == (ConnectConfig("C1", False, Endpoint("0.0.0.0", 0), "0.0.0.0", 0, False, 0),)
    assert project.instances == (InstanceDecl("X", "TRCV_C", "C1", None, "MAIN", ()),)
    assert (project.start, project.sim, project.peers, project.data) == ("", SimDecl(), (), ())


def test_t3_carries_eight_connections() -> None:
    assert read(SMALLEST.replace("\n", '\nmodel = "T3"\n', 1)).connection_limit == 8


def test_an_instance_without_a_task_is_called_by_the_first_one() -> None:
    tasks = '[[task]]\nname = "FAST"\ninterval = "T#1ms"\n[[task]]\nname = "SLOW"\ninterval = "T#1s"\n'
    instance = read(ONE_INSTANCE + tasks).instance("X")
    assert instance is not None and instance.task == "FAST"


@pytest.mark.parametrize(
    ("line", "shows"),
    [
        ('LocalAddress = "0.0.0.0"', "8081"),
        ('LocalAddress = "224.0.0.1"', "8081"),
        ('LocalAddress = "255.255.255.255"', "8081"),
        ("LocalPort = 65535", "a port like any other"),
        ("RemotePort = 0", "80A0 of an active CONNECT"),
        ("KeepAliveTimeInterval = 65535", "what the system's limit of 32767 s makes of it"),
        ("ActiveEstablished = 1", "TRUE: 1 is a BOOL literal"),
    ],
)
def test_what_a_connect_can_hold_is_left_to_the_block(line: str, shows: str) -> None:
    assert read(SMALLEST + line).connects[0].name == "C1", shows


@pytest.mark.parametrize("length", [0, 65535, 65536, 70000, 4294967295])
def test_every_udint_is_a_len(length: int) -> None:
    assert read(ONE_INSTANCE + f"LEN = {length}").instances[0].inputs == (("LEN", length),)


def test_a_port_may_be_a_name(folder: Path) -> None:
    text = SMALLEST + (
        'RemotePort = "@P2"\n[[connect]]\nname = "C2"\nRemotePort = "@C1"\n'
        '[[peer]]\nname = "P1"\nactive = true\nremote = "@C1"\n'
        '[[peer]]\nname = "P2"\nactive = false\nlocal = "127.0.0.1:0"\n'
    )
    project = read(text)
    assert [config.remote_port for config in project.connects] == ["@P2", "@C1"]
    assert [peer.end for peer in project.peers] == ["@C1", Endpoint("127.0.0.1", 0)]


def test_a_peer_with_a_remote_is_active_and_one_without_ends_listens_on_a_free_port() -> None:
    active = '[[peer]]\nname = "P"\nremote = "@C1"\nlocal = "127.0.0.2:4000"\n'
    assert read(SMALLEST + active + '[[peer]]\nname = "Q"\nactive = false\n').peers == (
        PeerDecl("P", True, "@C1", Endpoint("127.0.0.2", 4000)),
        PeerDecl("Q", False, Endpoint("127.0.0.1", 0)),
    )


def test_the_simulated_network_is_described() -> None:
    sim = (
        '[sim]\naddresses = ["10.0.0.1"]\nnot_ethernet = ["10.0.0.2"]\n'
        'seed = 7\nlatency = "T#3ms"\nfragment = true\n'
    )
    assert read(SMALLEST + sim).sim == SimDecl(("10.0.0.1",), ("10.0.0.2",), 7, 3_000_000, True)


def test_pins_come_with_their_direction_for_whoever_draws_them() -> None:
    project = read(ONE_INSTANCE)
    assert [pin.name for pin in project.pins("TRCV_C") if pin.is_bool][:2] == ["EN_R", "CONT"]


def test_names_are_looked_up() -> None:
    project = read(ONE_INSTANCE + '[[peer]]\nname = "P"\n')
    assert project.instance("X") is project.instances[0] and project.instance("x") is None
    assert project.connect("C1") is project.connects[0] and project.connect("") is None
    assert project.peer("P") is project.peers[0] and project.peer("Q") is None
    assert project.data_decl("rx") is None


def test_several_udt_files_may_use_each_other(tmp_path: Path) -> None:
    (tmp_path / "a.st").write_text("TYPE A : STRUCT b : B; END_STRUCT END_TYPE")
    (tmp_path / "b.st").write_text("TYPE B : STRUCT x : INT; END_STRUCT END_TYPE")
    text = SMALLEST + '[[udt]]\nfile = "a.st"\n[[udt]]\nfile = "b.st"\n[[data]]\nname = "rx"\ntype = "A"\n'
    assert [leaf.path for leaf in read(text, tmp_path).data[0].layout.leaves()] == ["b.x"]


@pytest.mark.parametrize("dialect", sorted(DIALECTS))
def test_each_dialect_crosses_to_another_process(dialect: str, folder: Path) -> None:
    project = read(f'dialect = "{dialect}"\n', folder)
    there = pickle.loads(pickle.dumps(project))
    assert there.dialect.name == dialect and there.dialect.answer({}) == project.dialect.answer({})


# -- scenario files ------------------------------------------------------------------------------------


def test_a_scenario_file_may_name_another_file_as_its_project(folder: Path) -> None:
    (folder / "bench.toml").write_text(CONTRACT)
    (folder / "sub").mkdir()
    (folder / "sub" / "s.toml").write_text('project = "../bench.toml"\n[scenario]\nsteps = ""\n')
    project, _ = load_scenario_document(folder / "sub" / "s.toml", ["model=T3"])
    assert (project.model, project.connects[0].name, project.data[0].size) == ("T3", "C1", 8)


def test_a_scenario_may_run_on_the_project_of_another_scenario_and_no_further(folder: Path) -> None:
    (folder / "one.toml").write_text(CONTRACT + '[scenario]\nsteps = "run 1"\n')
    (folder / "two.toml").write_text('project = "one.toml"\n[scenario]\nsteps = "run 2"\n')
    (folder / "three.toml").write_text('project = "two.toml"\n[scenario]\nsteps = ""\n')
    project, scenario = load_scenario_document(folder / "two.toml")
    assert (project.connects[0].name, scenario["steps"]) == ("C1", "run 2")
    with pytest.raises(UserError, match=r"two.toml: project: found an unknown key"):
        load_scenario_document(folder / "three.toml")


def test_of_a_file_in_an_unknown_dialect_the_dialect_alone_is_wrong() -> None:
    with pytest.raises(UserError) as caught:
        read('dialect = "s7-9000"\n[[connect]]\nname = "C1"\nID = 1\n')
    assert caught.value.lines() == ["bench.toml: dialect: found 's7-9000', expected s7-1500"]


def test_a_mistake_in_the_frame_of_a_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)

    def load(text: str) -> None:
        Path("s.toml").write_text(text)
        load_scenario_document("s.toml")

    golden.mistakes("frames of scenarios", load)


def test_a_project_alone_knows_no_scenario_key() -> None:
    with pytest.raises(UserError, match=r"bench.toml: scenario: found an unknown key"):
        read(SMALLEST + '[scenario]\nname = "s"\n')


def test_a_scenario_file_is_also_a_project(tmp_path: Path) -> None:
    (tmp_path / "bench.toml").write_text('dialect = "baosky"\n[[connect]]\nname = "C1"\n')
    (tmp_path / "play.toml").write_text('project = "bench.toml"\n[scenario]\nsteps = "run 1"\n')
    assert load_project(tmp_path / "play.toml").connects == load_project(tmp_path / "bench.toml").connects


DATA = """
[[data]]
name = "rx"
type = "ARRAY[0..7] OF BYTE"
optimized = true
"""
INSTANCE = """
[[connect]]
name = "C1"

[[instance]]
name = "T"
block = "TRCV_C"
connect = "C1"
ADHOC = true
"""


def project(dialect: str, tables: str) -> Project:
    return read_project(tomllib.loads(f'dialect = "{dialect}"\n{tables}'), "b.toml", Path("."))


def mistake(dialect: str, tables: str) -> str:
    with pytest.raises(UserError) as raised:
        project(dialect, tables)
    [line] = raised.value.lines()
    return line


def test_data_may_be_symbolic() -> None:
    [data] = project("s7-1500", DATA).data
    assert data.optimized
    [plain] = project("s7-1500", DATA.replace("optimized = true", "")).data
    assert not plain.optimized


def test_to_other_vendors_symbolic_means_nothing() -> None:
    assert mistake("baosky", DATA) == (
        "b.toml: data rx: optimized: found an unknown key, expected one of name, type, "
        "layout, byte_order, text, pointer_size, string_even"
    )


def test_instructions_before_3_have_no_adhoc_pin() -> None:
    assert mistake("s7-1200-legacy", INSTANCE) == (
        "b.toml: instance T: ADHOC: found a pin, "
        "expected another one: blocks of s7-1200-legacy have no pin of that name"
    )
    newer = project("s7-1500", INSTANCE)
    assert "ADHOC" in [pin.name for pin in newer.pins("TRCV_C")]
    older = project("s7-1200-legacy", INSTANCE.replace("ADHOC = true", ""))
    assert "ADHOC" not in [pin.name for pin in older.pins("TRCV_C")]
