"""Why and what next of refusals: shipped scenarios are played, what is told of their edges is read."""

from __future__ import annotations

from functools import cache

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import ERROR, Condition
from trcvtui.diagnosis.advice import RULES, Advice, Moves, advice_on
from trcvtui.diagnosis.evidence import NOTHING_KNOWN, evidence_then
from trcvtui.history.records import Moment
from trcvtui.plc.ledger import Line, StatusEdge
from trcvtui.scenario.scenario import load_scenario
from trcvtui.scenario.step_runner import StepRunner

# scenario, condition, block, what why says, what the first check that knows says
SITUATIONS = [
    ("description-faults", Condition.ID_WRONG, "the connection description is wrong, ID is 0, 1 to 4095",
     "TCON_IP_v4.ID is byte 2 of id_0, and holds 00 00"),
    ("description-faults", Condition.NAME_NOT_FULL, "RemoteQDN does not end with a dot",
     "a whole name ends with a dot: plc2.line.local."),
    ("80d3-names", Condition.NAME_UNKNOWN, "the DNS server does not know plc9.line.invalid.",
     "`getent hosts plc9.line.invalid.`"),
    ("80a1-80a2-port", Condition.PORT_RESERVED, "port 102 is the system's own; take 2000 to 5000",
     "`IsoPort = 2102` in [[connect]]"),
    ("80a1-80a2-port", Condition.PORT_IN_USE, "bind gave EADDRINUSE", "`ss -ltnp` names it"),
    ("1-9-connect-refused", Condition.REFUSED, "connect gave ECONNREFUSED",
     "answers with RST: the machine is there, and nothing listens on that port"),
    ("iso-refused", Condition.REFUSED, "the partner took the call and refused it in the handshake",
     "make the selectors fit crosswise: its remote one has to be"),
    ("80c6-unreachable", Condition.UNREACHABLE, "connect gave EHOSTUNREACH", "that was injected here"),
    ("1-8-trcv_c-lets-go", Condition.LET_GO, "closed on our side", "another block on C1 closed or reset it"),
    ("1-9-tsend_c-idle", Condition.FOUND_CLOSED, "the partner closed", "no job ran, so no bytes are lost"),
    ("80c9-message-too-long", Condition.MESSAGE_TOO_LONG, "the message is longer than LEN or DATA",
     "the message had 17 bytes: 1 byte too many, and it is lost"),
    ("8085-8088-len", Condition.LEN_OVER_DATA, "LEN is larger than DATA: LEN is 9, wanted 9, at most 8 bytes",
     "LEN is 9, DATA (rx) has 8 bytes: 1 too many"),
    ("80b1-changed-while-sending", Condition.AREA_CHANGED, "DATA changed while the job ran",
     "keep DATA as it is until DONE or ERROR: change it while BUSY is 0"),
    ("8088-symbolic", Condition.DATA_SYMBOLIC, "DATA is symbolic, so LEN has to be 0",
     "LEN=0` moves all of DATA"),
    ("1-10-t_diag-and-t_reset-while-waiting", Condition.RESULT_WRONG, "RESULT is too small",
     "has 15 bytes, the diagnosis has 16"),
    ("1-10-single-losses", Condition.ENDPOINT_THERE, "REQ rose", "C1 is built already"),
    ("80c8-80a3-80aa-one-id-twice", Condition.ID_OTHER, "another CONNECT has this ID",
     "give OTHER one that is free"),
    ("80c8-80a3-80aa-one-id-twice", Condition.ID_BUILDING, "another CONNECT has this ID",
     "build it once, or give SAME another ID"),
    ("80c3-other-priority", Condition.CONNECT_IN_USE, "a block of another priority works on this CONNECT",
     ""),
    ("8088-len-of-a-string", Condition.LEN_OF_TEXT, "LEN cuts STRING[5]: 0, or from 7 on",
     "LEN=0` moves the whole text"),
    ("udp-errors", Condition.REMOTE_WRONG, "ADDR names no address", "write both address and port"),
    ("udp-80c9-too-long", Condition.MESSAGE_TOO_LONG, "the datagram is larger than LEN or DATA",
     "the datagram had 9 bytes, 1 too many"),
    ("1-10-t_diag-and-t_reset-while-waiting", Condition.FINISHED, "REQ rose", "byte 6 is State"),
    ("tls-description-faults", Condition.TLS_SERVER_BARE, "TLSServerCertRef is 0",
     "TLSServerCertRef is byte 18 of"),
    ("tls-80e6-record-changed", Condition.TLS_INTEGRITY, "recv gave EBADMSG", "that was injected here"),
]  # fmt: skip


@cache
def played(name: str) -> tuple[Bench, tuple[Line, ...]]:
    """Play a scenario; return its bench and what its ledger has."""
    scenario = load_scenario(CONFIGS / "scenarios" / "siemens" / f"{name}.toml")
    bench = Bench(scenario.project, "sim")
    stage = StepRunner(bench)
    for step in (*scenario.start, *scenario.steps):
        for _ in stage.take(step):
            bench.step()
    lines = tuple(bench.runtime.ledger)
    bench.close()
    return bench, lines


def told(name: str, condition: Condition) -> Advice:
    """Return what is told of the first edge that shows a condition."""
    bench, lines = played(name)
    line, edge = next(
        (line, line.event)
        for line in lines
        if isinstance(line.event, StatusEdge) and line.event.condition == str(condition)
    )
    until = Moment(line.scan, line.t_ns)
    return advice_on(evidence_then(line, edge, NOTHING_KNOWN, until, bench.project, 10_000_000))


@pytest.mark.parametrize(("name", "condition", "why", "check"), SITUATIONS)
def test_a_refusal_says_why_and_what_to_look_at_with_its_numbers(
    name: str, condition: Condition, why: str, check: str
) -> None:
    advice = told(name, condition)
    assert why in advice.why
    assert any(check in each for each in advice.checks), advice.checks


def test_each_refusal_has_something_to_look_at() -> None:
    silent = {Condition.NOT_NOW, Condition.QUEUE_FULL, Condition.NO_BUFFER}  # the cause says it all
    silent |= {Condition.POLL_DEL_FAILED, Condition.DISCONNECT_FAILED, Condition.RESET_FAILED}
    general = [rule for rule in RULES if rule.moves is Moves.ANYTHING and not rule.says_why]
    assert set(ERROR) - {condition for rule in general for condition in rule.conditions} == silent
