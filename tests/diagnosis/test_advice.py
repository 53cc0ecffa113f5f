"""Why and what next, with the actual numbers: each situation is played on the simulated network."""

from __future__ import annotations

from dataclasses import replace

import pytest
from msgspec import structs

from tests.bench.told import UP, Told
from trcvtui.blocks.conditions import Condition
from trcvtui.diagnosis import advice
from trcvtui.diagnosis.advice import RULES, Moves, advice_on, rows
from trcvtui.diagnosis.evidence import Evidence
from trcvtui.diagnosis.job import DO

# situation, instance, the whole of why, what stands in the checks
SITUATIONS = [
    pytest.param(
        (*UP, "run 100"), "X",
        "waiting for 96 bytes; none received yet. The link is up since scan 5, 1.0 s",
        "P1 has sent nothing on this connection",
        id="armed, nothing came",
    ),
    pytest.param(
        (*UP, "set X LEN=0", "peer P1 send random 96 seed=1", "run 30"), "X",
        "waiting for 96 bytes; none received yet. The last frame (96 bytes) was delivered in scan 9, "
        "0.2 s ago",
        "",
        id="armed between two frames is not stuck",
    ),
    pytest.param(
        (*UP, "peer P1 send random 96 seed=1 split=10,10,10 gap=T#100ms", "run 25"), "X",
        "receiving: 30 of 96 bytes received, the last one 0.0 s ago, 136 B/s",
        "",
        id="filling, with its rate",
    ),
    pytest.param(
        (*UP, "peer P1 send random 92 seed=1", "run 200"), "X",
        "stuck: 92 of 96 bytes received, the last one 1.9 s ago",
        "LEN is 0 and DATA (rx) has 96 bytes. P1's only message was 92 bytes: LEN or DATA is 4 bytes too "
        "large for this sender",
        id="a sender 4 bytes short",
    ),
    pytest.param(
        (*UP, "peer P1 send random 64 seed=1", "run 200"), "X",
        "stuck: 64 of 96 bytes received, the last one 1.9 s ago",
        "`set X ADHOC=1` to get the 64 bytes at once",
        id="stuck, and ADHOC would help",
    ),
    pytest.param(
        (*UP, "set X EN_R=0", "run 1", "set X EN_R=1 LEN=96",
         "peer P1 send random 64 seed=1 repeat=41 every=T#50ms", "run 400"), "X",
        "stuck: 32 of 96 bytes received, the last one 1.9 s ago",
        "LEN is 96. P1's last 40 messages were 64 bytes: LEN or DATA is 32 bytes too large for this sender. "
        "Each frame takes 32 bytes of the next message, so the values wander",
        id="LEN 96 against messages of 64",
    ),
    pytest.param(
        (*UP, "peer P1 send random 32 seed=1 repeat=2 gap=T#50ms", "run 200"), "X",
        "stuck: 64 of 96 bytes received, the last one 1.9 s ago",
        "P1's last 2 messages were 32 bytes: one frame takes 3 of them, 2 are here",
        id="three messages a frame",
    ),
    pytest.param(
        (*UP, "peer P1 send random 100 seed=1", "run 200"), "X",
        "stuck: 4 of 96 bytes received, the last one 1.9 s ago",
        "P1's only message was 100 bytes. LEN is 0 and DATA (rx) has 96 bytes, which is too small for this "
        "sender: 4 bytes of each message begin a next frame",
        id="a sender 4 bytes too long",
    ),
    pytest.param(
        (*UP, "peer P1 send random 10 seed=1", "run 10", "peer P1 send random 20 seed=1", "run 200"), "X",
        "stuck: 30 of 96 bytes received, the last one 1.9 s ago",
        "P1's last 2 messages had 10 to 20 bytes, a static frame has always 96",
        id="messages of many sizes",
    ),
    pytest.param(
        (*UP, "peer P1 send random 96 seed=1 repeat=3", "run 30", "peer P1 send random 92 seed=1", "run 200"),
        "X",
        "stuck: 92 of 96 bytes received, the last one 1.9 s ago",
        "P1's newest message was 92 bytes, those before it 96: it is 4 bytes short of a frame",
        id="one message 4 bytes short",
    ),
    pytest.param(
        (*UP, "peer P1 send random 96 seed=1 split=4 gap=T#100ms", "run 3", "set X EN_R=0", "run 2",
         "set X EN_R=1", "run 200"), "X",
        "stuck: 92 of 96 bytes received, the last one 1.9 s ago",
        "EN_R fell in scan 12 with 4 of 96 bytes collected; they were dropped. This frame begins with "
        "byte 4 of P1's message 1: the stream is shifted",
        id="EN_R dropped in mid frame",
    ),
    pytest.param(
        (*UP, "peer P1 send random 96 seed=1 split=4 gap=T#100ms", "run 3", "set X EN_R=0", "run 3"), "X",
        "EN_R is 0",
        "EN_R fell in scan 12 with 4 of 96 bytes collected; they were dropped, and the next frame begins "
        "in the middle of a message, with byte 4 of P1's message 1",
        id="EN_R dropped, and not yet back",
    ),
    pytest.param(
        (*UP, "peer P1 send random 64 seed=1", "run 3", "set X EN_R=0 ADHOC=1", "run 2", "set X EN_R=1",
         "run 9"),
        "X",
        "waiting for up to 96 bytes (ADHOC); none received yet. The last byte came 0.1 s ago",
        "",
        id="an ad-hoc job wants up to its limit",
    ),
    pytest.param(
        ("set X CONT=1", "run 300"), "X",
        "waiting for any partner since scan 3, 2.9 s, listening on 10.0.0.1:32769",
        "`peer P1 connect` lets it call",
        id="nobody has called",
    ),
    pytest.param(
        ("set Z CONT=1", "run 5", "peer P3 connect", "run 5", "peer P3 connect", "run 5"), "Z",
        "waiting for a call from 10.0.0.7 since scan 3, 0.1 s, listening on 10.0.0.1:32769",
        "called twice (last in scan 11) and was turned away: RemoteAddress is 10.0.0.7",
        id="the wrong partner calls",
    ),
    pytest.param(
        ("peer P2 close", "set Y CONT=1", "run 230"), "Y",
        "waiting for 10.0.0.9:32768 since scan 3, 2.2 s; refused 3 times (ECONNREFUSED, last in scan 206); "
        "the next attempt in 0.7 s",
        "10.0.0.9:32768 answers with RST: the machine is there, and nothing listens on that port (3 times",
        id="refused",
    ),
    pytest.param(
        ("peer P2 close", "set Y CONT=1", "run 230"), "Y",
        "waiting for 10.0.0.9:32768 since scan 3, 2.2 s; refused 3 times (ECONNREFUSED, last in scan 206); "
        "the next attempt in 0.7 s",
        "P2 is closed and does not listen",
        id="refused by a peer of this bench",
    ),
    pytest.param(
        ("fault connect ECONNREFUSED on C2", "set Y CONT=1", "run 20"), "Y",
        "waiting for 10.0.0.9:32768 since scan 3, 0.1 s; refused once (ECONNREFUSED, injected, last in scan 4"
        "); the next attempt in 0.8 s",
        "a fault that was injected here did that, not the network",
        id="refused by an injected fault",
    ),
    pytest.param(
        ("set V CONT=1", "run 300"), "V",
        "waiting for 10.0.0.50:2000 since scan 3, 2.9 s; SYN unanswered in attempt 1",
        "try `nc -vz 10.0.0.50 2000` from this machine",
        id="a SYN without answer",
    ),
    pytest.param(
        ("fault bind EADDRINUSE on C1", "set X CONT=1", "run 3"), "X",
        "injected fault: bind gave EADDRINUSE",
        "another program or CONNECT has 10.0.0.1:0",
        id="the port is taken",
    ),
    pytest.param(
        (*UP, "peer P4 connect", "run 3"), "X",
        "waiting for 96 bytes; none received yet. The link is up since scan 5, 0.0 s",
        "was turned away once (last in scan 9): a CONNECT has one partner at a time",
        id="a second client",
    ),
    pytest.param(
        ("set U CONT=1 EN_R=1", "run 4", "peer P5 send hex 01 02 03", "run 200"), "U",
        "waiting for one datagram of at most 96 bytes; none received yet. The last datagram (3 bytes) was "
        "delivered in scan 5, 1.9 s ago",
        "RCVD_LEN says 3",
        id="a datagram is whole, whatever its size",
    ),
    pytest.param(
        (*UP, "peer P1 rst", "run 9"), "X",
        "waiting for any partner since scan 9, 0.0 s, listening on 10.0.0.1:32769",
        "ended in scan 9 after 0.0 s: lost (ECONNRESET)",
        id="lost before",
    ),
    pytest.param(
        (*UP, "set X2 CONT=1 EN_R=1", "run 9"), "X2",
        "another instance works on this CONNECT, X",
        "`set X EN_R=0` frees it; better give each a CONNECT of its own",
        id="two blocks on one CONNECT",
    ),
    pytest.param(
        (*UP, "set X2 CONT=1 EN_R=1", "peer P1 send random 9 seed=1", "run 3", "delete X", "run 3"), "X2",
        "an instance that is gone still holds this CONNECT, X: disconnect or reset frees it",
        "X was deleted or downloaded in mid frame and still holds the receive side of C1",
        id="an orphan holds the CONNECT",
    ),
    pytest.param(
        (*UP, "set X EN_R=0", "run 1", "set X EN_R=1 LEN=100", "run 1"), "X",
        "LEN is larger than DATA: LEN is 100, wanted 100, at most 96 bytes",
        "LEN is 100, DATA (rx) has 96 bytes: 4 too many",
        id="LEN larger than DATA",
    ),
    pytest.param(
        (*UP, "set X EN_R=0", "set OPEN CONT=1 EN_R=1", "run 4"), "OPEN",
        "DATA has no byte",
        "the DATA pin is open",
        id="an open DATA pin",
    ),
    pytest.param(
        ("set X EN_R=1", "run 3"), "X",
        "CONT is 0",
        "CONT is 0 while EN_R is 1",
        id="CONT forgotten",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("lines", "instance", "why", "check"), SITUATIONS)
def test_a_situation_is_told_with_its_numbers(
    lines: tuple[str, ...], instance: str, why: str, check: str
) -> None:
    told = Told(*lines).of(instance)
    assert told.why == why
    assert any(check in sentence for sentence in told.checks) or (not check and not told.checks), told.checks


def test_a_partner_that_does_not_read_is_named() -> None:
    up = ("set X CONT=1", "set S CONT=1", "run 4", "peer P1 connect", "run 6", "peer P1 stall")
    told = Told(*up, options="small_buffers = true")
    for _ in range(40):
        told.do("pulse S REQ", "run 3")
    told.do("run 2")
    answer = told.of("S")
    assert ("P1 was told to stop reading" in answer.causes, answer.do[0]) == (True, "`peer P1 resume`")
    assert any("does not read; its receive call is off" in check for check in answer.checks), answer.checks


@pytest.mark.parametrize(
    ("lines", "condition", "check"),
    [
        (
            ("peer P1 send random 92 seed=1", "run 3", "peer P1 close", "run 9"), Condition.PARTNER_CLOSED,
            "it had sent whole messages: each has 92 bytes, the frame wants 96: 4 bytes short",
        ),
        (
            ("peer P1 send random 92 seed=1", "run 3", "peer P1 rst", "run 9"), Condition.RECEIVE_FAILED,
            "reset (RST) with 92 of 96 bytes of the job done",
        ),
        (
            ("peer P1 send random 92 seed=1", "run 3", "peer P1 close", "run 9"), Condition.RECEIVING,
            "P1's only message was 92 bytes: LEN or DATA is 4 bytes too large for this sender",
        ),
        (
            ("peer P1 send random 96 seed=1 split=10 gap=T#100ms", "run 3", "set X EN_R=0", "run 2",
             "set X EN_R=1", "run 50"), Condition.CONNECTED,
            "EN_R fell in scan 12 with 10 of 96 bytes collected; they were dropped, and the next frame "
            "begins in the middle of a message, with byte 10 of P1's message 1",
        ),
        (
            ("fault recv ECONNRESET on C1", "peer P1 send random 92 seed=1", "run 9"),
            Condition.RECEIVE_FAILED,
            "a fault that was injected here did that, not the network",
        ),
    ],
)  # fmt: skip
def test_an_edge_of_the_past_is_told_with_the_numbers_of_its_scan(
    lines: tuple[str, ...], condition: Condition, check: str
) -> None:
    told = Told(*UP, *lines).then("X", condition)
    assert any(check in sentence for sentence in told.checks), told.checks


def test_facts_survive_a_flood_that_the_lines_do_not() -> None:
    told = Told(*UP, "peer P1 send random 96 seed=1 split=4 gap=T#50ms", "run 3", "set X EN_R=0", "run 2")
    told.do("set X EN_R=1", "peer P1 send random 96 seed=1 repeat=400 every=T#20ms", "run 1000")
    picture = told.picture("X", most_lines=10)
    assert picture.lines_skipped > 1000
    facts = dict(picture.facts)["X"]
    assert facts.drop is not None
    assert (facts.drop.reason, facts.drop.have, facts.drop.need) == ("EN_R fell", 4, 96)
    assert facts.messages.count == 401
    assert len(facts.messages.last) == 40


def test_a_reset_stream_is_not_called_shifted_any_more() -> None:
    told = Told(*UP, "peer P1 send random 96 seed=1 split=4 gap=T#50ms", "run 3", "set X EN_R=0", "run 2")
    told.do("set X EN_R=1", "run 20")
    assert any("shifted" in check for check in told.of("X").checks)
    told.do("pulse X COM_RST", "run 5", "peer P1 connect", "run 5", "peer P1 send random 96 seed=1", "run 5")
    assert not any("shifted" in check for check in told.of("X").checks)


def test_each_later_frame_of_a_shifted_stream_names_the_scan_in_which_en_r_fell() -> None:
    told = Told(*UP, "peer P1 send random 96 seed=1 split=4 gap=T#50ms", "run 3", "set X EN_R=0", "run 2")
    told.do("set X EN_R=1", "peer P1 send random 96 seed=1 repeat=20 every=T#50ms", "run 300")
    named = "EN_R fell in scan 12 with 4 of 96 bytes collected; they were dropped. This frame begins with"
    shifted = "byte 4 of P1's message {}: the stream is shifted"
    now, then = told.of("X").checks, told.then("X", Condition.RECEIVED).checks
    assert any(check.startswith(f"{named} {shifted.format(21)}") for check in now)
    assert any(check.startswith(f"{named} {shifted.format(20)}") for check in then)


def test_a_frame_given_up_between_two_messages_shifts_nothing() -> None:
    told = Told(
        *UP, "peer P1 send random 48 seed=1", "run 3", "set X EN_R=0", "run 2", "set X EN_R=1", "run 2"
    )
    told.do("peer P1 send random 48 seed=1", "run 3")
    assert not any("shifted" in check for check in told.of("X").checks)


def test_a_partner_that_is_no_peer_is_known_by_its_bursts() -> None:
    told = Told(*UP, "peer P1 send random 64 seed=1", "run 200")
    known = told.evidence("X")
    stranger = replace(
        known, facts=structs.replace(known.facts, sender="", messages=type(known.facts.messages)())
    )
    checks = advice_on(stranger).checks
    assert (
        "LEN is 0 and DATA (rx) has 96 bytes, bytes came once, 64: if that is the sender's message, LEN or "
        "DATA is 32 too large" in checks
    )


def test_a_stream_without_a_pause_is_not_called_a_message() -> None:
    told = Told(*UP, "peer P1 send random 960 seed=1 repeat=40 every=T#10ms", "run 20")
    known = told.evidence("X")
    stranger = replace(
        known, facts=structs.replace(known.facts, sender="", messages=type(known.facts.messages)())
    )
    checks = " ".join(advice_on(stranger).checks)
    assert "bytes came without a pause: a stream does not show where a message ends" in checks
    assert "if that is the sender's message" not in checks


def test_of_a_burst_that_is_over_the_bytes_after_its_last_frame_are_counted() -> None:
    told = Told(*UP, "peer P1 send random 200 seed=1", "run 200")
    known = told.evidence("X")
    stranger = replace(
        known, facts=structs.replace(known.facts, sender="", messages=type(known.facts.messages)())
    )
    assert any(
        check.endswith(
            "bytes came once, 200: if that is the sender's message, its last 8 bytes begin a next frame"
        )
        for check in advice_on(stranger).checks
    )


def test_a_frame_that_is_all_here_is_complete_and_not_filling() -> None:
    known = replace(Told(*UP, "peer P1 send random 40 seed=1", "run 3").evidence("X"), have=96)
    assert advice_on(known).why == "complete: all 96 bytes received, DONE comes with the next scan"


def test_a_slow_sender_is_not_called_stuck() -> None:
    told = Told(*UP, "peer P1 send random 96 seed=1 split=10,10,10,10,10 gap=T#2s", "run 780")
    assert told.of("X").why.startswith("receiving: ")


@pytest.mark.slow
@pytest.mark.parametrize("condition", list(Condition))
def test_every_condition_has_an_answer_whatever_is_known(condition: Condition) -> None:
    known = Told(*UP).evidence("X")
    bare = Evidence("X", "TRCV_C", str(condition), known.cause, known.at, 1, 10_000_000)
    for evidence in (replace(known, condition=str(condition)), bare, replace(bare, is_past=True)):
        told = advice_on(evidence)
        assert told.why
        assert all(check and "None" not in check for check in told.checks), told.checks


def test_no_rule_is_asked_twice_for_one_condition() -> None:
    asked = [(c, rule.moves, rule.tell, rule.says_why) for rule in RULES for c in rule.conditions]
    assert len(set(asked)) == len(asked)


def test_a_rule_is_one_row_and_shows_on_the_card(monkeypatch: pytest.MonkeyPatch) -> None:
    made_up = rows(Condition.PARTNER_CLOSED, lambda e: f"the machine is away{DO}{e.instance}: look after it")
    monkeypatch.setattr(advice, "RULES", (*RULES, *made_up))
    told = Told(*UP, "peer P1 close", "run 9")
    card = told.then("X", Condition.PARTNER_CLOSED)
    assert (card.causes[-1], card.do[-1]) == ("the machine is away", "X: look after it")


def test_a_rule_of_what_moves_replaces_the_general_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    of_datagrams = rows(Condition.PARTNER_CLOSED, lambda e: "of datagrams", of=Moves.DATAGRAMS)
    monkeypatch.setattr(advice, "RULES", (*RULES, *of_datagrams))
    told = Told(*UP, "peer P1 close", "run 9").then("X", Condition.PARTNER_CLOSED)
    assert "of datagrams" not in told.checks


def test_a_fin_is_no_error_of_recv() -> None:
    told = Told(*UP, "peer P1 close", "run 9").then("X", Condition.PARTNER_CLOSED)
    assert "recv gave 0 bytes" in told.why
    assert "error" not in told.why
