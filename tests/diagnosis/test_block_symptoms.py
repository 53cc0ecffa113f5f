"""An ERROR is a symptom where it stands at the end or comes again; what is over is none."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, CauseKind
from trcvtui.diagnosis.block_symptoms import BlockSymptoms
from trcvtui.net.layers.layered_stream import SESSION_ENDED
from trcvtui.plc.ledger import BenchNote, Outputs, StatusEdge
from trcvtui.project.file import load_project

REFUSED = Cause(CauseKind.PARTNER, "connect gave ECONNREFUSED", call="connect", error="ECONNREFUSED")
HANDSHAKE = Cause(CauseKind.PARTNER, "the handshake failed", call="session", error="TLS_WRONG_NAME")


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench(load_project(CONFIGS / "active.toml"), "sim")
    yield made
    made.close()


def shown(bench: Bench, condition: Condition, cause: Cause = REFUSED, done: bool = False) -> StatusEdge:
    decl = bench.project.instances[0]
    is_error = condition in (Condition.CONNECT_FAILED, Condition.LENGTH_WRONG, Condition.TLS_HANDSHAKE)
    outputs = Outputs(0x80A0 if is_error else 0x7004, False, done, is_error, 0)
    return StatusEdge(decl.name, decl.block, outputs, condition, cause)


@pytest.mark.parametrize(
    ("conditions", "found"),
    [
        ([Condition.CONNECT_FAILED], ["80A0 once"]),
        ([Condition.CONNECT_FAILED] * 3, ["80A0 3 times"]),
        ([Condition.CONNECT_FAILED, Condition.CONNECTED], []),
        ([Condition.CONNECT_FAILED, Condition.CONNECTED, Condition.CONNECT_FAILED], ["80A0 twice"]),
        # A connection does not end what has nothing to do with it.
        ([Condition.LENGTH_WRONG, Condition.CONNECTED], ["80A0 once"]),
        ([Condition.LENGTH_WRONG, Condition.RECEIVED], []),
        # Another ERROR took the place of the first one.
        ([Condition.CONNECT_FAILED, Condition.LENGTH_WRONG], ["80A0 once"]),
    ],
)
def test_an_error_counts_where_it_stands_or_comes_again(
    bench: Bench, conditions: list[Condition], found: list[str]
) -> None:
    symptoms = BlockSymptoms(bench, 0)
    for scan, condition in enumerate(conditions, 1):
        symptoms.add_event(scan, scan * 10**7, shown(bench, condition, done=condition is Condition.RECEIVED))
    found_now = symptoms.list_findings(is_running=False)
    texts = [one.explains[0] for one in found_now]
    assert [text.split(" showed ")[1].split(":")[0] for text in texts] == found
    assert all(one.status == ("80A0",) and one.mend for one in found_now)


def test_an_error_that_is_expected_is_none(bench: Bench) -> None:
    cause = Cause(CauseKind.INPUT, "EN_R is 1 without a connection", is_expected=True)
    symptoms = BlockSymptoms(bench, 0)
    symptoms.add_event(1, 0, shown(bench, Condition.CONNECT_FAILED, cause))
    assert symptoms.list_findings(is_running=False) == ()


def test_an_error_of_a_handshake_has_the_words_of_the_library(bench: Bench) -> None:
    words = "the partner's certificate: IP address mismatch"
    symptoms = BlockSymptoms(bench, 0)
    symptoms.add_event(1, 0, BenchNote(bench.project.instances[0].connect, SESSION_ENDED, words))
    symptoms.add_event(1, 0, shown(bench, Condition.TLS_HANDSHAKE, HANDSHAKE))
    (found,) = symptoms.list_findings(is_running=False)
    assert found.explains[0].endswith(words)
