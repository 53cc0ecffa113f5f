"""Why and what next of Siemens connections: ISO-on-TCP, TLS, names, descriptions, UDP; in virtual time."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from tests.bench.told import Told
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import Condition
from trcvtui.engine.engine import LocalDriver
from trcvtui.history.link_statistics import LinkStatistics
from trcvtui.history.stream_index import StreamIndex
from trcvtui.net.events import ConnectionChanged, What
from trcvtui.net.results import Fault
from trcvtui.project.file import read_project

TSAPS = 'ActiveEstablished = false\nLocalTSelector = "16#E002"\nRemoteTSelector = "16#E001"\nIsoPort = 0'
ARMED = ("set TRCV_C_1 CONT=1 EN_R=1", "run 20")


def desk(path: Path, *lines: str, old: str = "", new: str = "") -> Told:
    """Return a bench of a shipped project in which `old` reads `new`, told these lines."""
    text = path.read_text(encoding="utf-8").partition("[scenario]")[0]
    assert old in text
    told = Told()
    project = read_project(tomllib.loads(text.replace(old, new, 1) if old else text), path.name, path.parent)
    told.driver, told.lines = LocalDriver(Bench(project, "sim")), []
    told.do(*lines)
    return told


def shipped(name: str, *lines: str, old: str = "", new: str = "") -> Told:
    """Return the same of a project in configs/."""
    return desk(CONFIGS / f"{name}.toml", *lines, old=old, new=new)


def said(told: Told, instance: str) -> str:
    """Return everything that is told of an instance now."""
    advice = told.of(instance)
    return "\n".join((advice.why, *advice.checks))


# -- after a failed attempt ---------------------------------------------------------------------------------


@pytest.mark.parametrize("data", ["", "00 01 02 03 04 05 06 07 08 09 0a 0b 0c 0d"])
def test_a_description_of_a_wrong_length_is_told_in_7002_too_and_sends_to_the_screen_of_it(data: str) -> None:
    told = shipped("s7-iso-passive", "set TSEND_C_1 CONT=1", "run 50", old=TSAPS, new=f'bytes = "{data}"')
    size = len(bytes.fromhex(data))
    advice = told.of("TSEND_C_1")
    assert advice.why.startswith(
        "C1 is not built since scan 2, 0.4 s: the connection description is wrong (press C), "
    )
    assert f"{size} bytes, TCON_IP_RFC has 80; the next attempt in" in advice.why
    assert advice.checks == (
        "the last attempt ended in 809A in scan 2",
        "take the structure alone, all of it: not the DB or UDT around it",
        "press `C`: the description of C1 byte for byte, what is wrong with it first",
    )
    assert advice.code == 0x809A


def test_a_wrong_tsap_of_our_own_is_no_matter_of_ports_in_7002() -> None:
    told = shipped("s7-iso-passive", "set TSEND_C_1 CONT=1", "run 250", old='"16#E002"', new='"16#1002"')
    first, *rest = told.of("TSEND_C_1").checks
    assert first.startswith("the last attempt ended in 80B4 in scan ")
    assert "TCON_IP_RFC.LocalTSelector is byte " in first
    assert any("press `C`" in line for line in rest)
    assert "peer P1 connect" not in "".join(rest)


def test_a_name_that_nobody_knows_is_what_7002_speaks_of() -> None:
    path = CONFIGS / "scenarios" / "siemens" / "80d3-names.toml"
    advice = desk(path, "set X_unknown CONT=1", "run 20").of("X_unknown")
    assert advice.why.startswith(
        "C2 is not built since scan 2, 0.1 s: the connection description is wrong (press C), "
    )
    assert "the DNS server does not know plc9.line.invalid." in advice.why
    assert advice.checks[0] == "the last attempt ended in 80D3 in scan 2"
    assert advice.do[0].startswith("`getent hosts plc9.line.inv")
    advice = desk(path, "set X_unknown CONT=1", "run 20", old='DnsAnswer = "0.0.0.0"\n').of("X_unknown")
    assert advice.why.startswith(
        "waiting for plc9.line.invalid. since scan 3, 0.1 s; the name was not found once"
    )
    assert advice.checks[0].startswith("the last attempt ended in 80D3 in scan 4")
    assert advice.do[0].startswith("`getent hosts plc9.line.inv")
    assert advice.code == 0x80D3


@pytest.mark.slow
def test_a_certificate_that_was_not_shown_stays_told_while_the_next_client_is_waited_for(
    secure_bench: Path,
) -> None:
    told = desk(secure_bench / "tls-server.toml", *ARMED, "peer bare connect", "run 60")
    evidence = told.evidence("TRCV_C_1")
    assert evidence.condition == Condition.ESTABLISHING
    advice = told.of("TRCV_C_1")
    first = advice.checks[0]
    assert first.startswith("the last attempt ended in 80E2 in scan ")
    assert "showed no certificate" in first
    assert advice.code == 0x80E2
    told.do("peer strange connect", "run 60")
    assert told.of("TRCV_C_1").checks[0].startswith("the last attempt ended in 80E4 in scan ")
    told.do("peer good connect", "run 20", "peer good close", "run 20")
    assert "last attempt" not in said(told, "TRCV_C_1")


def test_what_kept_a_connection_from_being_built_is_forgotten_when_it_is_built() -> None:
    index = StreamIndex()
    statistics = LinkStatistics(index)
    failed = ConnectionChanged(
        "C1", 0, What.ATTEMPT_FAILED, fault=Fault("description", "wrong TSAP"), detail="x"
    )
    index.take([(2, 20, failed)])
    attempt = statistics.facts("X", "C1").attempt
    assert attempt is not None
    assert (attempt.at.scan, attempt.cause.call, attempt.cause.detail) == (2, "description", "x")
    index.take([(102, 1020, ConnectionChanged("C1", 0, What.CONNECTING))])
    facts = statistics.facts("X", "C1")
    assert (facts.attempt, facts.failures) == (None, ())


# -- TSAPs ---------------------------------------------------------------------------------------------------


def test_a_refused_tsap_of_an_active_end_is_crosswise_and_no_refusal_of_tcp() -> None:
    told = shipped("s7-iso-active", *ARMED, "run 400", old='= "TCP-2"\nIso', new='= "NO-SUCH"\nIso')
    advice = told.of("TRCV_C_1")
    assert "; taken and refused by the partner 5 times (last in scan " in advice.why
    assert "ECONNREFUSED" not in said(told, "TRCV_C_1")
    first = advice.checks[0]
    assert first.startswith("the last attempt ended in 80C5 in scan ")
    assert "its remote one has to be TCP-1 (54 43 50 2D 31) (our local one)" in advice.do[0]
    assert "its local one NO-SUCH (4E 4F 2D 53 55 43 48)" in advice.do[0]
    assert first.endswith(" (DR, reason 03)")


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('remote_tsap = "16#E002"', 'remote_tsap = "16#E007"', "no CONNECT has the TSAP e0 07"),
        ('local_tsap = "16#E001"', 'local_tsap = "16#E005"', "the TSAP e0 05 is not the partner's"),
    ],
)
def test_a_caller_with_another_tsap_is_told_and_not_asked_to_call_again(old: str, new: str, why: str) -> None:
    told = shipped(
        "s7-iso-passive", "set TSEND_C_1 CONT=1", "run 5", "peer P1 connect", "run 20", old=old, new=new
    )
    advice = told.of("TSEND_C_1")
    assert advice.why.startswith("waiting for a call with the TSAP E0 01 since scan 1,")
    assert advice.checks == (
        f"P1 called and was refused in scan 7: {why}; C1 is E0 02 (LocalTSelector), its partner E0 01",
    )


def test_whoever_shares_the_port_hears_of_a_tsap_that_nobody_has() -> None:
    second = (
        '[[connect]]\nname = "C2"\ntype = "TCON_IP_RFC"\nActiveEstablished = false\nID = 2\n'
        'LocalTSelector = "16#E003"\nIsoPort = 0\n\n[[instance]]\nname = "B"\nblock = "TSEND_C"\n'
        'connect = "C2"\ndata = "tx"\n\n[[peer]]\nname = "P1"'
    )
    text = (CONFIGS / "s7-iso-passive.toml").read_text(encoding="utf-8")
    text = text.replace('[[peer]]\nname = "P1"', second).replace(
        'remote_tsap = "16#E002"', 'remote_tsap = "16#E007"'
    )
    told = Told()
    told.driver = LocalDriver(Bench(read_project(tomllib.loads(text), "b.toml", Path(".")), "sim"))
    told.do("set TSEND_C_1 CONT=1", "set B CONT=1", "run 5", "peer P1 connect", "run 20")
    for instance, own in (("TSEND_C_1", "C1 is E0 02"), ("B", "C2 is E0 03")):
        assert f"no CONNECT has the TSAP e0 07; {own}" in said(told, instance)


# -- messages ------------------------------------------------------------------------------------------------


def test_a_shorter_message_ends_a_job_of_iso_and_lacks_no_bytes() -> None:
    told = shipped("s7-iso-active", *ARMED, "peer P1 send hex 01 02 03", "run 20")
    advice = told.of("TRCV_C_1")
    assert advice.why.startswith(
        "waiting for one message of at most 16 bytes; none received yet. The last message (3 bytes)"
    )
    assert advice.checks[0] == (
        "LEN is 0 and DATA (rx) has 16 bytes, the last message had 3 bytes. A message is a whole job "
        "whatever its size: RCVD_LEN says 3, and DATA keeps older bytes from byte 3 on"
    )
    assert "too large for this sender" not in said(told, "TRCV_C_1")


def test_trcv_on_iso_waits_for_a_message_and_not_for_the_rest_of_a_frame() -> None:
    told = shipped("s7-iso-passive", "set TSEND_C_1 CONT=1", "set TRCV_1 EN_R=1", "run 5", "peer P1 connect")
    told.do("run 20")
    assert told.of("TRCV_1").why.startswith("waiting for one message of at most 16 bytes; none received yet")


def test_messages_longer_than_data_are_lost_and_not_cut_into_frames() -> None:
    told = shipped("s7-iso-active", *ARMED, "peer P1 send random 20 seed=1", "run 20")
    assert (
        "P1's messages have 20 bytes, LEN is 0 and DATA (rx) has 16 bytes: each is 4 too long, and lost"
    ) in told.of("TRCV_C_1").checks


# -- datagrams of the _C blocks -----------------------------------------------------------------------------


def test_trcv_c_on_udp_waits_for_a_datagram_and_not_for_a_frame() -> None:
    told = shipped("s7-udp-connect", *ARMED)
    advice = told.of("TRCV_C_1")
    assert advice.why.startswith(
        "waiting for one datagram of at most 8 bytes; none received yet. The socket is"
    )
    assert advice.checks == ("P2 has sent nothing", "`peer P2 send hex 01`")
    told.do("peer P2 send hex 01 02 03", "run 20")
    assert "the only datagram had 3 bytes. A datagram is a whole job" in said(told, "TRCV_C_1")


def test_done_of_tsend_c_on_udp_says_nothing_of_the_partner() -> None:
    told = shipped("s7-udp-connect", "set TSEND_C_1 CONT=1", "run 20", "pulse TSEND_C_1 REQ", "run 1")
    assert told.of("TSEND_C_1").checks == (
        "DONE tells that the local stack took the datagram; UDP does not tell whether it came",
    )


# -- STOP and RUN -------------------------------------------------------------------------------------------


def test_since_when_a_partner_is_waited_for_begins_anew_after_stop_and_after_cont() -> None:
    told = shipped("s7-receiver", "set TRCV_C_1 CONT=1", "run 400")
    assert " since scan 1, 3.9 s" in told.of("TRCV_C_1").why
    told.do("plc stop", "run 100")
    assert told.of("TRCV_C_1").checks == ("the PLC is in STOP, no block is called", "`plc run`")
    told.do("plc run", "run 10")
    assert " since scan 501, 0.0 s" in told.of("TRCV_C_1").why
    told.do("set TRCV_C_1 CONT=0", "run 10", "set TRCV_C_1 CONT=1", "run 10")
    assert " since scan 521, 0.0 s" in told.of("TRCV_C_1").why


# -- instructions before 3.0 ----------------------------------------------------------------------------


def test_older_instructions_have_len_0_in_the_place_of_adhoc() -> None:
    told = shipped("s7-legacy-receiver", *ARMED, "peer P1 connect", "run 20")
    assert told.of("TRCV_C_1").why.startswith(
        "waiting for up to 8 bytes (LEN 0 is ad hoc); none received yet"
    )
    assert "ADHOC" not in said(told, "TRCV_C_1")
    assert "delivered" not in said(told, "TRCV_C_1")  # the DONE before was that of the connection
    told = shipped("s7-legacy-receiver", "set TRCV_C_1 LEN=8", *ARMED, "peer P1 connect", "run 20")
    told.do("peer P1 send hex 01 02 03", "run 200")
    assert "stuck: 3 of 8 bytes received" in told.of("TRCV_C_1").why
    assert "LEN=0, which is ad hoc here, would have delivered the 3 bytes" in said(told, "TRCV_C_1")


# -- cont_mode manual: REQ and EN_R connect, too ------------------------------------------------------------


@pytest.mark.parametrize(
    ("project", "instance", "lines", "why", "check"),
    [
        (
            "s7-sender", "TSEND_C_1", ("run 2",), "CONT is 0 and REQ has not risen",
            "`pulse TSEND_C_1 REQ` to connect, send and disconnect, or `set TSEND_C_1 CONT=1` to",
        ),
        (
            "s7-sender", "TSEND_C_1", ("set TSEND_C_1 REQ=1", "run 30"), "CONT is 0 and REQ has not risen",
            "set it to 0 first, then `pulse TSEND_C_1 REQ` to connect, send and disconnect",
        ),
        (
            "s7-receiver", "TRCV_C_1", ("run 2",), "CONT and EN_R are 0",
            "`set TRCV_C_1 EN_R=1` to connect, receive and disconnect, or `set TRCV_C_1 CONT=1` to stay",
        ),
        (
            "s7-receiver", "TRCV_C_1", ("set TRCV_C_1 EN_R=1", "run 1"), "EN_R is 1 without a connection", "",
        ),
    ],
)  # fmt: skip
def test_an_s7_1200_without_a_connection_is_told_what_connects(
    project: str, instance: str, lines: tuple[str, ...], why: str, check: str
) -> None:
    advice = shipped(project, *lines, old="s7-1500", new="s7-1200").of(instance)
    assert why in advice.why
    assert not check or any(line.startswith(check) for line in advice.checks), advice.checks


def test_the_close_of_a_job_with_cont_0_is_told_by_its_cause() -> None:
    told = shipped("s7-sender", "pulse TSEND_C_1 REQ", "run 12", old="s7-1500", new="s7-1200")
    assert told.then("TSEND_C_1", Condition.CLOSING).why.startswith("CONT was 0 when REQ rose")
