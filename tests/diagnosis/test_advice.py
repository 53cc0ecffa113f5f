"""Why and what next: each situation is played on the simulated network, and told by the rule that knows it.

The situations and the sentences stand in golden/advice.txt: `RULE: BENCH | INSTANCE[, CONDITION] | LINES`, a
condition asks for the newest edge of the past that shows it; `-`: no rule speaks.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from msgspec import structs

from tests import golden
from tests.bench.told import UP, Told
from tests.local_driver import LocalDriver
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.table import BLOCKS
from trcvtui.diagnosis import advice
from trcvtui.diagnosis.advice import ADVICE_RULES, Advice, Traffic, make_advice, make_rules
from trcvtui.diagnosis.evidence import NO_FACTS, Evidence, make_past_evidence
from trcvtui.diagnosis.job import tip
from trcvtui.dialects import DIALECTS
from trcvtui.history.link_statistics import LinkStatistics
from trcvtui.history.records import ScanStamp
from trcvtui.history.stream_index import StreamIndex
from trcvtui.net.events import ConnectionChanged, EventKind
from trcvtui.net.results import Fault
from trcvtui.plc.ledger import Line, StatusEdge
from trcvtui.project.file import read_project
from trcvtui.scenario.scenario import load_scenario
from trcvtui.scenario.step_runner import StepRunner

UDP = """
dialect = "baosky"
[[data]]
name = "rx"
type = "ARRAY[0..15] OF BYTE"
[[udp_config]]
name = "U1"
LocalAddress = "127.0.0.1"
LocalPort = 2000
[[addr]]
name = "TARGET"
RemoteAddress = "127.0.0.1"
RemotePort = 3000
[[addr]]
name = "SOURCE"
[[instance]]
name = "R"
block = "URECV_C"
config = "U1"
data = "rx"
addr = "SOURCE"
[[instance]]
name = "S"
block = "USEND_C"
config = "U1"
data = "rx"
addr = "TARGET"
[[peer]]
name = "P"
udp = true
local = "127.0.0.1:{local}"
remote = "127.0.0.1:{remote}"
"""
SIEMENS = UDP.replace('"baosky"', '"s7-1500"').replace("URECV_C", "TURCV").replace("USEND_C", "TUSEND")


def desk(text: str, *lines: str, base: Path = CONFIGS) -> Told:
    told = Told()
    project = read_project(tomllib.loads(text.partition("[scenario]")[0]), "b.toml", base)
    told.driver, told.lines = LocalDriver(Bench(project, "sim")), []
    told.do(*lines)
    return told


def bench_of(place: str, lines: list[str]) -> Told:
    """Return a bench: told, udp or tudp (TUSEND) with the ports of its peer, else PROJECT [OLD => NEW]."""
    name, _, change = place.partition(" ")
    if name == "told":
        return Told(*lines)
    if name in ("udp", "tudp"):
        local, remote = change.split()
        text = UDP if name == "udp" else SIEMENS
        return desk(text.format(local=local, remote=remote), *lines)
    path = CONFIGS / f"{name}.toml"
    old, _, new = change.replace("\\n", "\n").partition(" => ")
    text = path.read_text(encoding="utf-8")
    assert old in text
    return desk(text.replace(old, new, 1) if old else text, *lines, base=path.parent)


def advice_of(case: str) -> Advice:
    place, asked, lines = case.split(" | ")
    instance, _, condition = asked.partition(", ")
    if place.startswith("scenario "):
        return advice_of_scenario(place.removeprefix("scenario "), Condition(condition))
    listed = lines.split("; ") if lines else []
    bench = bench_of(place, [each for line in listed for each in (UP if line == "UP" else (line,))])
    return bench.then(instance, Condition(condition)) if condition else bench.of(instance)


@cache
def played(name: str) -> tuple[Bench, tuple[Line, ...]]:
    """Play a scenario; return its bench and what its ledger has."""
    scenario = load_scenario(CONFIGS / "scenarios" / "siemens" / f"{name}.toml")
    bench = Bench(scenario.project, "sim")
    stage = StepRunner(bench)
    for step in (*scenario.start, *scenario.steps):
        for _ in stage.run_step(step):
            bench.step()
    lines = tuple(bench.runtime.ledger)
    bench.close()
    return bench, lines


def advice_of_scenario(name: str, condition: Condition) -> Advice:
    bench, lines = played(name)
    line, edge = next(
        (line, line.event)
        for line in lines
        if isinstance(line.event, StatusEdge) and line.event.condition == str(condition)
    )
    until = ScanStamp(line.scan, line.t_ns)
    return make_advice(make_past_evidence(line, edge, NO_FACTS, until, bench.project, 10_000_000))


def rules_of(told: Advice) -> tuple[str, ...]:
    """Return the names of the rules that spoke, that of the last attempt first."""
    return (*(["last_attempt"] if told.code is not None else []), *(rule.__name__ for rule in told.rules))


def as_told(told: Advice) -> Iterator[str]:
    yield told.why
    yield from (f"- {cause}" for cause in told.causes)
    yield from (f"> {each.text}" for each in told.do)
    if told.code is not None:
        yield f"code {told.code:04X}"


SECTIONS = ("baosky", "datagrams", "edges of the past", "projects", "refusals")


@pytest.mark.parametrize("section", SECTIONS)
def test_a_situation_is_told_by_its_rule(section: str) -> None:
    said, wrong = [], []
    for rule, case in golden.cases("advice", section):
        told = advice_of(case)
        said.append((f"{rule}: {case}", as_told(told)))
        if rule not in (rules_of(told) or ("-",)):
            wrong.append((case, rule, told))
    assert wrong == []
    golden.agree("advice", section, said)


# -- what a sentence does not show ---------------------------------------------------------------------------


def stranger(*lines: str) -> Evidence:
    """Return what is known of a partner that is no peer of this bench."""
    known = Told(*UP, *lines).evidence("X")
    return replace(
        known, facts=structs.replace(known.facts, sender="", messages=type(known.facts.messages)())
    )


@pytest.mark.parametrize(
    ("lines", "has_message"),
    [
        (("peer P1 send random 64 seed=1", "run 200"), True),
        (("peer P1 send random 200 seed=1", "run 200"), True),
        (("peer P1 send random 960 seed=1 repeat=40 every=T#10ms", "run 20"), False),
    ],
    ids=["too short", "too long", "without a pause"],
)
def test_a_partner_that_is_no_peer_is_known_by_its_bursts(lines: tuple[str, ...], has_message: bool) -> None:
    (check,) = [line for line in make_advice(stranger(*lines)).causes if "bytes came" in line]
    assert ("If that is the size of a message" in check) is has_message


def test_a_partner_that_does_not_read_is_named() -> None:
    up = ("set X CONT=1", "set S CONT=1", "run 4", "peer P1 connect", "run 6", "peer P1 stall")
    told = Told(*up, options="small_buffers = true")
    for _ in range(40):
        told.do("pulse S REQ", "run 3")
    told.do("run 2")
    answer = told.of("S")
    assert (set(rules_of(answer)), answer.do[0].text) == (
        {"explain_stall", "explain_not_reading"},
        "`peer P1 resume`",
    )


CUT = ("peer P1 send random 96 seed=1 split=4 gap=T#50ms", "run 3", "set X EN_R=0", "run 2")


def test_facts_survive_a_flood_that_the_lines_do_not() -> None:
    told = Told(
        *UP, *CUT, "set X EN_R=1", "peer P1 send random 96 seed=1 repeat=400 every=T#20ms", "run 1000"
    )
    picture = told.picture("X", most_lines=10)
    assert picture.lines_skipped > 1000
    facts = dict(picture.facts)["X"]
    assert facts.drop is not None
    assert (facts.drop.reason, facts.drop.have, facts.drop.need) == ("EN_R fell", 4, 96)
    assert facts.messages.count == 401
    assert len(facts.messages.last) == 40


def test_a_reset_stream_is_not_called_shifted_any_more() -> None:
    told = Told(*UP, *CUT, "set X EN_R=1", "run 20")
    assert "explain_shift_by_drop" in rules_of(told.of("X"))
    told.do("pulse X COM_RST", "run 5", "peer P1 connect", "run 5", "peer P1 send random 96 seed=1", "run 5")
    assert "explain_shift_by_drop" not in rules_of(told.of("X"))


def test_each_later_frame_of_a_shifted_stream_names_the_scan_in_which_en_r_fell() -> None:
    told = Told(*UP, *CUT, "set X EN_R=1", "peer P1 send random 96 seed=1 repeat=20 every=T#50ms", "run 300")
    for advised, message in ((told.of("X"), 21), (told.then("X", Condition.RECEIVED), 20)):
        (check,) = [line for line in advised.causes if "shifted" in line]
        assert "EN_R fell in scan 12" in check and f"message {message}" in check


def test_a_frame_given_up_between_two_messages_shifts_nothing() -> None:
    half, again = "peer P1 send random 48 seed=1", ("set X EN_R=0", "run 2", "set X EN_R=1", "run 2")
    told = Told(*UP, half, "run 3", *again, half, "run 3")
    assert "explain_shift_by_drop" not in rules_of(told.of("X"))


def test_a_frame_that_is_all_here_is_complete_and_a_slow_sender_is_not_stuck() -> None:
    whole = replace(Told(*UP, "peer P1 send random 40 seed=1", "run 3").evidence("X"), have=96)
    assert make_advice(whole).why.startswith("complete: ")
    slow = Told(*UP, "peer P1 send random 96 seed=1 split=10,10,10,10,10 gap=T#2s", "run 780")
    assert slow.of("X").why.startswith("receiving: ")


@pytest.mark.slow
def test_every_condition_has_an_answer_whatever_is_known() -> None:
    known = Told(*UP).evidence("X")
    wrong = []
    for condition in Condition:
        bare = Evidence("X", "TRCV_C", str(condition), known.cause, known.at, 10_000_000)
        for evidence in (replace(known, condition=str(condition)), bare, replace(bare, is_past=True)):
            told = make_advice(evidence)
            if not told.why or not all(told.checks) or "None" in " ".join(told.checks):
                wrong.append((condition, told))
    assert wrong == []


def test_no_rule_is_asked_twice_for_one_condition() -> None:
    asked = [(c, rule.traffic, rule.tell, rule.says_why) for rule in ADVICE_RULES for c in rule.conditions]
    assert len(set(asked)) == len(asked)


def test_each_error_has_something_to_look_at_on_its_card() -> None:
    known = {condition for rule in ADVICE_RULES if not rule.says_why for condition in rule.conditions}
    rows_of = [row for dialect in DIALECTS.values() for row in dialect.status if row.conditions]
    bare = {row.word for row in rows_of if not row.checks and not known & {*row.conditions}}
    assert bare == set()


def test_a_rule_is_one_row_and_one_of_what_moves_replaces_the_general_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made_up = make_rules(
        Condition.PARTNER_CLOSED, lambda e: tip("the machine is away", f"{e.instance}: look after it")
    )
    of_datagrams = make_rules(Condition.PARTNER_CLOSED, lambda e: "of datagrams", of=Traffic.DATAGRAMS)
    monkeypatch.setattr(advice, "ADVICE_RULES", (*ADVICE_RULES, *made_up, *of_datagrams))
    told = Told(*UP, "peer P1 close", "run 9").then("X", Condition.PARTNER_CLOSED)
    assert (told.causes[-1], told.do[-1].text) == ("the machine is away", "X: look after it")
    assert "recv gave 0 bytes" in told.why  # a FIN is no error of recv


def test_a_block_sends_or_receives_and_its_pins_say_which() -> None:
    assert {"TSEND_C", "TSEND", "TUSEND", "USEND_C"} == {
        name for name, row in BLOCKS.items() if row.sends_on_net
    }
    assert {"TRCV_C", "TRCV", "TURCV", "URECV_C"} == {
        name for name, row in BLOCKS.items() if row.receives_on_net
    }


@pytest.mark.slow
def test_a_certificate_that_was_not_shown_stays_told_while_the_next_client_is_waited_for(
    secure_bench: Path,
) -> None:
    text = (secure_bench / "tls-server.toml").read_text(encoding="utf-8")
    told = desk(text, "set TRCV_C_1 CONT=1 EN_R=1", "run 20", base=secure_bench)
    for name, code in (("bare", 0x80E2), ("strange", 0x80E4)):
        told.do(f"peer {name} connect", "run 60")
        assert told.evidence("TRCV_C_1").condition == Condition.ESTABLISHING
        advised = told.of("TRCV_C_1")
        assert (advised.code, rules_of(advised)[0]) == (code, "last_attempt")
    told.do("peer good connect", "run 20", "peer good close", "run 20")
    assert "last_attempt" not in rules_of(told.of("TRCV_C_1"))


def test_what_kept_a_connection_from_being_built_is_forgotten_when_it_is_built() -> None:
    index = StreamIndex()
    statistics = LinkStatistics(index)
    fault = Fault("description", "wrong TSAP")
    index.dispatch_events(
        [(2, 20, ConnectionChanged("C1", 0, EventKind.ATTEMPT_FAILED, fault=fault, detail="x"))]
    )
    attempt = statistics.facts("X", "C1").attempt
    assert attempt is not None
    assert (attempt.at.scan, attempt.cause.call, attempt.cause.detail) == (2, "description", "x")
    index.dispatch_events([(102, 1020, ConnectionChanged("C1", 0, EventKind.CONNECTING))])
    facts = statistics.facts("X", "C1")
    assert (facts.attempt, facts.failures) == (None, ())


def test_whoever_shares_the_port_hears_of_a_tsap_that_nobody_has() -> None:
    second = (
        '[[connect]]\nname = "C2"\ntype = "TCON_IP_RFC"\nActiveEstablished = false\nID = 2\n'
        'LocalTSelector = "16#E003"\nIsoPort = 0\n\n[[instance]]\nname = "B"\nblock = "TSEND_C"\n'
        'connect = "C2"\ndata = "tx"\n\n[[peer]]\nname = "P1"'
    )
    text = (CONFIGS / "s7-iso-passive.toml").read_text(encoding="utf-8")
    text = text.replace('[[peer]]\nname = "P1"', second)
    text = text.replace('remote_tsap = "16#E002"', 'remote_tsap = "16#E007"')
    told = desk(text, "set TSEND_C_1 CONT=1", "set B CONT=1", "run 5", "peer P1 connect", "run 20")
    for instance, own in (("TSEND_C_1", "C1 has E0 02"), ("B", "C2 has E0 03")):
        assert any(f"no CONNECT has the TSAP e0 07; {own}" in line for line in told.of(instance).causes)
