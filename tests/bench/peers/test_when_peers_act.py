"""On the simulated network peers act when they are due; the PLC's scans decide nothing of it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Final

import pytest

from tests.bench.bench_lines import do
from tests.replay.journals import again, jsonl, recorded
from trcvtui.bench.bench import Bench
from trcvtui.project.file import read_project
from trcvtui.recording.journal import REST, CallRecord
from trcvtui.replay.command import find_difference

MS: Final = 1_000_000
INTERVALS: Final = 1, 10, 30, 50, 200
TEXT: Final = """
dialect = "baosky"
[[task]]
name = "MAIN"
interval = "T#{interval}ms"
[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"
LocalPort = 2000
RemoteAddress = "0.0.0.0"
[[data]]
name = "rx"
type = "ARRAY[0..63] OF BYTE"
[[instance]]
name = "X"
block = "TRCV_C"
connect = "C1"
data = "rx"
CONT = true
[sim]
latency = "T#{latency}ms"
"""
CALLS: Final = """
[[peer]]
name = "P1"
active = true
remote = "@C1"
reconnect = "T#1s"
says = ["hex 01 02 03", "hex 04 05"]
every = "T#30ms"
"""
ASKS: Final = """
[[peer]]
name = "P1"
udp = true
local = "127.0.0.1:7001"
remote = "127.0.0.1:7002"
says = ['text "one?"', 'text "two?" split=2 gap=T#15ms']
every = "T#70ms"
[[peer]]
name = "P2"
udp = true
local = "127.0.0.1:7002"
remote = "127.0.0.1:7001"
replies = ['contains text "?" send text "yes" split=1 gap=T#3ms']
"""


def bench_of(peers: str, interval: int, latency: int = 0) -> Bench:
    text = TEXT.format(interval=interval, latency=latency) + peers
    return Bench(read_project(tomllib.loads(text), "b.toml", Path()), "sim")


def seen(bench: Bench, *lines: str, until: int = 6000) -> list[list[int]]:
    """Return how much each peer has sent and received, every 600 ms."""
    found: list[list[int]] = []
    while bench.now < until * MS:
        bench.step()
        do(bench, *lines if bench.runtime.scans == 1 else ())
        if not bench.now % (600 * MS):
            found.append([bench.now // MS])
            for peer in bench.peer_snapshots():
                found[-1] += [peer.messages_sent, peer.bytes_sent, peer.bytes_received]
    bench.close()
    return found


def test_a_peer_that_speaks_each_30_ms_does_so_at_every_interval_of_the_plc() -> None:
    for_each = [seen(bench_of(CALLS, interval)) for interval in INTERVALS]
    assert for_each[0][-1] == [6000, 167, 418, 0]  # from 1000 ms on
    assert for_each == [for_each[0]] * len(INTERVALS)


@pytest.mark.parametrize("latency", [0, 7])
def test_answers_pieces_and_what_is_on_its_way_wait_for_no_scan(latency: int) -> None:
    for_each = [seen(bench_of(ASKS, interval, latency)) for interval in INTERVALS]
    assert for_each == [for_each[0]] * len(INTERVALS)


def test_a_peer_acts_at_most_each_100_us_however_often_it_is_asked_to() -> None:
    calls = CALLS.replace("T#1s", "T#100ms").partition("says")[0]
    often = seen(bench_of(calls, 20), "peer P1 check on every=T#1us", until=1200)
    assert [messages for _, messages, *_ in often] == [0, 5001, 11001]


def test_what_peers_did_between_scans_is_recorded_and_runs_again(tmp_path: Path) -> None:
    (tmp_path / "b.toml").write_text(TEXT.format(interval=50, latency=7) + CALLS + ASKS.replace("P1", "P3"))
    file = tmp_path / "s.toml"
    steps = "set X EN_R=1 LEN=10\\nrun T#4s"
    file.write_text(f'project = "b.toml"\n[scenario]\nname = "s"\nsteps = "{steps}"\n')
    text, entries = recorded(file)
    acted = [entry.args for entry in entries if isinstance(entry, CallRecord) and entry.call == REST]
    assert acted[:6] == [(at * MS,) for at in (7, 10, 14, 17, 70, 77)]
    assert find_difference(again(entries)) == ""
    assert jsonl(entries) == text
    assert text.count('"DONE":true') == 24  # 10 of the 245 bytes each that have come by 3950 ms
    assert recorded(file) == (text, entries)
