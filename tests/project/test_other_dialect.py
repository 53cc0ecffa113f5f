"""A project in another dialect: what goes over, what is left out with a note, what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.dialects import DIALECTS
from trcvtui.errors import UserError
from trcvtui.net.connection.description_check import Flaw
from trcvtui.net.layers.iso_on_tcp import IsoSettings
from trcvtui.net.results import Endpoint
from trcvtui.project.convert_dialect import Translation, convert_project
from trcvtui.project.file import load_project, read_project
from trcvtui.project.project import Project

C1 = {"name": "C1", "LocalAddress": "127.0.0.1"}


def project(dialect: str, connect: dict[str, Any], **more: object) -> Project:
    document = {"dialect": dialect, "connect": [{"name": "C1"} | connect], **more}
    return read_project(document, "line", Path())


def over(given: Project, dialect: str) -> Translation:
    return convert_project(given, DIALECTS[dialect])


@pytest.mark.parametrize("name", ["passive", "sender", "duplex", "s7-receiver", "s7-sender", "s7-pair"])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_plain_tcp_project_goes_over_whole(name: str, dialect: str) -> None:
    given = load_project(CONFIGS / f"{name}.toml")
    other, notes = over(given, dialect)
    assert all(" is written as a " in note for note in notes)
    assert other.dialect.name == dialect
    assert other.model in other.dialect.models
    assert [i.name for i in other.instances] == [i.name for i in given.instances]
    for before, after in zip(given.connects, other.connects, strict=True):
        assert (after.description is not None) == other.dialect.describes_connects
        assert after.flaw is None
        assert (after.active, after.local) == (before.active, before.local)
        assert (after.remote_address, after.remote_port) == (before.remote_address, before.remote_port)


def test_there_and_back_is_the_same_connect() -> None:
    given = load_project(CONFIGS / "sender.toml")
    assert over(over(given, "s7-1500").project, "baosky").project.connects == given.connects


def test_a_switch_goes_over_by_its_name_when_it_was_changed() -> None:
    options = {"retry": "T#200ms", "queue": 3, "not_connected": "hold", "max_len": "65536"}
    other, notes = over(project("baosky", C1, options=options), "s7-1500")
    assert (other.options["retry"], other.options["queue"]) == (200_000_000, 3)
    assert other.rules.policy.retry_ns == 200_000_000
    assert notes == (
        "option not_connected = hold is left out: s7-1500 has no such switch",
        "option max_len = 65536 is left out: s7-1500 has no such switch",
    )


def test_blocks_and_pins_that_the_other_dialect_lacks_are_left_out() -> None:
    given = project(
        "s7-1500",
        C1,
        data=[{"name": "d", "type": "ARRAY[0..15] OF BYTE"}],
        instance=[
            {"name": "T1", "block": "T_DIAG", "connect": "C1", "data": "d"},
            {"name": "R1", "block": "TRCV_C", "connect": "C1", "data": "d", "ADHOC": False},
        ],
    )
    assert over(given, "baosky").notes[1:] == ("T1 is left out: baosky has no T_DIAG",)
    other, notes = over(given, "s7-1200-legacy")
    assert [(i.name, i.inputs) for i in other.instances] == [("R1", ())]
    assert notes[-1:] == ("R1: ADHOC is left out: TRCV_C has no such pin",)


@pytest.mark.parametrize("dialects", [("s7-1500", "s7-1200-legacy"), ("s7-1200-legacy", "s7-1500")])
def test_who_receives_ad_hoc_does_so_in_a_dialect_that_has_no_adhoc_pin(dialects: tuple[str, str]) -> None:
    adhoc: dict[str, dict[str, object]] = {"s7-1500": {"ADHOC": True}, "s7-1200-legacy": {"LEN": 65535}}
    receiver = {"name": "R1", "block": "TRCV_C", "connect": "C1", "data": "d"}
    given = project(
        dialects[0],
        C1,
        data=[{"name": "d", "type": "ARRAY[0..15] OF BYTE"}],
        instance=[receiver | adhoc[dialects[0]]],
    )
    (made,) = over(given, dialects[1]).project.instances
    assert dict(made.inputs) == adhoc[dialects[1]]


def test_len_0_that_a_switch_makes_ad_hoc_is_ad_hoc_in_the_other_dialect() -> None:
    receiver = {"name": "R1", "block": "TRCV_C", "connect": "C1"}
    for value, expected in (("adhoc", {"ADHOC": True}), ("data", {})):
        given = project("s7-1200-legacy", C1, instance=[receiver], options={"legacy_len0": value})
        (made,) = over(given, "s7-1500").project.instances
        assert dict(made.inputs) == expected


def test_a_record_has_fields_that_a_description_lacks_and_the_other_way_round() -> None:
    record = {"ActiveEstablished": True, "RemoteAddress": "10.0.0.7", "RemotePort": 2000}
    other, notes = over(project("baosky", record | {"SendDelayOpt": True}), "s7-1500")
    assert other.connects[0].any_local
    assert notes == (
        "C1: LocalAddress 0.0.0.0 is left out: a description names none",
        "C1: SendDelayOpt is left out: a description has no such field",
    )
    sim = {"addresses": ["10.0.0.1"]}
    plain, notes = over(project("s7-1500", record, sim=sim), "baosky")
    assert plain.connects[0].local == Endpoint("10.0.0.1", 0)
    assert notes[1:] == ("C1: LocalAddress 10.0.0.1 is chosen: the description names none",)


def test_what_a_cpu_finds_wrong_in_a_description_is_said_where_nobody_looks_for_it() -> None:
    (_, note) = over(project("s7-1500", {"ID": 5000}), "baosky").notes
    assert note.startswith("C1: ") and note.endswith(": baosky does not check that")


def test_iso_on_tcp_goes_to_another_cpu_with_its_limit_and_not_to_plain_tcp() -> None:
    given = load_project(CONFIGS / "s7-iso-passive.toml")
    session = over(given, "s7-1200").project.connects[0].session
    assert isinstance(session, IsoSettings) and session.cap == 8192
    with pytest.raises(UserError) as refused:
        over(given, "baosky")
    (line,) = refused.value.lines()
    assert line.startswith("baosky: connect ")
    assert line.endswith("found ISO-on-TCP (TCON_IP_RFC), expected plain TCP by address")


def test_instructions_before_3_get_tcp_and_iso_in_a_tcon_param() -> None:
    tcp = over(load_project(CONFIGS / "s7-sender.toml"), "s7-1200-legacy").project.connects[0]
    iso = over(load_project(CONFIGS / "s7-iso-passive.toml"), "s7-1200-legacy").project.connects[0]
    assert tcp.description is not None and iso.description is not None
    assert [one.structure.name for one in (tcp.description, iso.description)] == ["TCON_Param"] * 2
    assert iso.description.number("connection_type") == 18
    assert isinstance(iso.session, IsoSettings) and iso.session.cap == 8192
    assert tcp.flaw is None
    assert iso.flaw is not None and iso.flaw.flaw is Flaw.TSAP  # E0 02: no T-selector of an S7-1200 (3.2)


def test_what_a_tcon_param_cannot_say_keeps_its_structure_and_its_flaw_is_told() -> None:
    name = {"type": "TCON_QDN", "ActiveEstablished": True, "RemoteQDN": "plc2.line.", "RemotePort": 2000}
    other, notes = over(project("s7-1500", name), "s7-1200-legacy")
    assert notes == ("C1: TCON_QDN: s7-1200-legacy takes TCON_Param only",)
    assert other.connects[0].flaw is not None


@pytest.mark.parametrize(
    ("dialect", "note"),
    [
        ("baosky", "C1: TCON_IP_v4 is written as a TCP_CONNECTCONFIG, without its ID"),
        ("s7-1200-legacy", "C1: TCON_IP_v4 is written as a TCON_Param"),
        ("s7-1200", ""),
    ],
)
def test_a_description_that_becomes_another_structure_is_told(dialect: str, note: str) -> None:
    assert over(project("s7-1500", C1), dialect).notes == ((note,) if note else ())
