"""The message of a send job has the bytes that the stack took of it: what the partner got, and no other."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from tests.scenario.scenarios import SCENARIOS
from trcvtui.bench.bench import Bench
from trcvtui.blocks.tcp.jobs import OutgoingJob
from trcvtui.engine.message_filter import read_filter
from trcvtui.errors import UserError
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.messages import MessageRow, MessageRows
from trcvtui.history.received_streams import ReceivedStreams
from trcvtui.net.received_ring import sent_ring_name
from trcvtui.scenario.runner import ScenarioRunner, VirtualPace
from trcvtui.scenario.scenario import load_scenario

SENT = sent_ring_name("")


class Messages(VirtualPace):
    """Takes the rows after each scan, before their bytes can go."""

    def __init__(self, bench: Bench) -> None:
        reader = LedgerReader(bench)
        self.rows = MessageRows(bench, reader, ReceivedStreams(bench, reader))
        self.taken: list[tuple[str, MessageRow]] = []

    def next_scan(self, bench: Bench) -> None:
        super().next_scan(bench)
        self.taken += self.rows.take_rows()


def played(path: Path, takes: bool = True) -> tuple[Bench, Messages]:
    scenario = load_scenario(path)
    bench = Bench(scenario.project, "sim")
    messages = Messages(bench)
    pace = messages if takes else VirtualPace()
    ScenarioRunner(bench, scenario.name, pace, lambda *_: None).play([*scenario.start, *scenario.steps])
    bench.close()
    return bench, messages


def test_every_scenario_has_of_each_send_job_what_the_stack_took(monkeypatch: pytest.MonkeyPatch) -> None:
    payloads: dict[tuple[str, int], bytes] = {}
    start = OutgoingJob._start

    def noted(job: OutgoingJob, payload: bytes) -> None:
        start(job, payload)
        payloads[job._instance, job.number] = payload

    monkeypatch.setattr(OutgoingJob, "_start", noted)
    found = Counter[str]()
    for path in SCENARIOS:
        payloads.clear()
        bench, messages = played(path)
        configs = {config.name for config in bench.project.udp_configs}
        for name, row in messages.taken:
            if not row.stream.endswith(SENT):
                continue
            payload = payloads[name, row.number]
            assert row.content == payload[: row.size]
            assert (row.size < len(payload)) <= bool(row.reason)
            kinds = {"cut": row.size < len(payload), "of a UDP_CONFIG": row.stream[: -len(SENT)] in configs}
            found.update([bench.project.dialect.name, *(kind for kind, it_is in kinds.items() if it_is)])
    assert found["cut"] > 10 and found["of a UDP_CONFIG"] > 10
    assert min(found[name] for name in ("baosky", "s7-1500", "s7-1200", "s7-1200-legacy", "twincat")) > 5


def test_the_partner_has_got_the_bytes_of_the_messages_and_old_ones_have_none() -> None:
    (path,) = [path for path in SCENARIOS if path.stem == "note-several-tsend-one-connect"]
    bench, messages = played(path, takes=False)
    names = [one.name for one in bench.project.instances]

    def rows() -> list[MessageRow]:
        found = [row for name in names for row in messages.rows.make_delta(name, 0).rows]
        return sorted(found, key=lambda row: row.position)

    sent = rows()
    assert b"".join(row.content or b"" for row in sent) == bytes(bench.peers["P1"].queues.inbox.last_bytes)
    ring = bench.runtime.received_ring(sent[0].stream)
    assert ring is not None and len(sent) > 1
    ring.most = sent[-1].size
    later = rows()
    assert [row.content for row in later] == [None] * (len(sent) - 1) + [sent[-1].content]
    assert [row.size for row in later] == [row.size for row in sent]
    with pytest.raises(UserError, match="expected one of length, status"):
        read_filter("a = 10", bench.project, names[0])
