"""A peer that acts by the clock keeps its beat; a session with one, saved on real sockets, holds again."""

from __future__ import annotations

import socket
from pathlib import Path

from trcvtui.bench.peers.peer import next_due
from trcvtui.cli.main import main
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.project.file import load_project
from trcvtui.scenario.recorded_session import StatusPattern
from trcvtui.scenario.scenario import load_scenario
from trcvtui.snapshots.bench import EngineTiming

MS = 1_000_000
LATE = 300_000  # ns that a live scan may begin after its time
BENCH = """
dialect = "baosky"
start = "set TRCV_C_1 CONT=1 EN_R=1"
[[data]]
name = "rx"
type = "ARRAY[0..5] OF BYTE"
[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"
LocalPort = 0
[[instance]]
name = "TRCV_C_1"
block = "TRCV_C"
connect = "C1"
data = "rx"
[[peer]]
name = "P1"
active = true
remote = "@C1"
"""
ROUTINE = 'reconnect = "T#50ms"\nevery = "T#100ms"\nsays = ["hex 01 02 03 04 05 06"]\n'


def live(folder: Path, text: str) -> Controller:
    file = folder / "bench.toml"
    file.write_text(text)
    return Controller(fresh_bench(load_project(file), "live"))


def drifting(console: Controller, scans: int, interval_ns: int = 10 * MS + LATE) -> None:
    """Let scans pass whose times drift away from their numbers, as after overruns."""
    for _ in range(scans):
        console.scan(console.bench.runtime.scans * interval_ns)


def answers(console: Controller, *lines: str) -> list[str]:
    for line in lines:
        console.handle_line(1, line)
    picture = console.picture(UpdateRequest(), EngineTiming(), 10)
    return [answer.error or answer.message for answer in picture.answers]


def test_late_scans_do_not_add_up_to_a_drift_of_what_a_peer_says(tmp_path: Path) -> None:
    console = live(tmp_path, BENCH + ROUTINE)
    spoken = []
    for number in range(1, 301):  # each scan up to 0.6 ms late, no later one more than an early one
        before = console.bench.peer_snapshots()[0].messages_sent
        console.scan((number - 1) * 10 * MS + (number % 3) * LATE)
        if console.bench.peer_snapshots()[0].messages_sent > before:
            spoken.append(number)
    console.bench.close()
    assert len(spoken) in (29, 30)
    assert abs(spoken[-1] - spoken[0] - 10 * (len(spoken) - 1)) <= 1


def test_what_was_missed_is_not_made_up_for() -> None:
    assert next_due(100, 10, 103) == 110
    assert next_due(100, 10, 110) == 120
    assert next_due(100, 10, 567) == 577


def test_a_session_on_real_sockets_whose_peer_acts_by_the_clock_holds_again(tmp_path: Path) -> None:
    console, file = live(tmp_path, BENCH + ROUTINE), tmp_path / "saved.toml"
    drifting(console, 150)
    assert answers(console, "peer P1 close") == [""]
    drifting(console, 120)
    assert "scans in" in answers(console, f"save scenario {file}")[0]
    console.bench.close()
    assert load_scenario(file).steps[-1].line.endswith("7006+ 7008 ...")
    assert main(["scenario", str(file), "--kernel", "sim"]) == 0


def test_a_session_whose_peer_is_told_what_to_send_expects_every_frame(tmp_path: Path) -> None:
    console, file = live(tmp_path, BENCH), tmp_path / "saved.toml"
    drifting(console, 6)
    answers(console, "peer P1 connect")
    drifting(console, 6)
    answers(console, "peer P1 send random 12 seed=1")
    drifting(console, 12)
    answers(console, f"save scenario {file}")
    console.bench.close()
    assert load_scenario(file).steps[-1].line.endswith("7006+ 7008 7006+ 7008 7006+")
    assert main(["scenario", str(file), "--kernel", "sim"]) == 0


def test_each_stretch_of_frames_ends_in_anything_and_an_error_between_them_stays() -> None:
    seen = StatusPattern(frozenset({0x7004, 0x7006}))
    for status in (0x7004, 0x7006, 0x7008, 0x7006, 0x7008, 0x7006):
        seen.add((status, False))
    seen.add((0x80C5, True))
    for status in (0x7002, 0x7004, 0x7006, 0x7008):
        seen.add((status, False))
    turns = (0x7004, 0x7006, 0x7008)
    assert seen.format_pattern(turns, (0x7008,)) == "7004+ 7006+ 7008 ... 80C5! 7002 7004+ 7006+ 7008 ..."


def test_a_partner_outside_the_bench_is_named_and_nothing_is_expected_of_it(tmp_path: Path) -> None:
    console, file = live(tmp_path, BENCH), tmp_path / "saved.toml"
    drifting(console, 6)
    port = int(console.bench.runtime.snapshot().connections[0].local.rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port)) as outside:
        outside.sendall(b"123456")
        name = f"127.0.0.1:{outside.getsockname()[1]}"
        drifting(console, 6)
        told = answers(console, f"save scenario {file}")[0]
    console.bench.close()
    assert told.endswith(f"; {name} is no peer of this bench and will not be replayed")
    scenario = load_scenario(file)
    assert f"A partner outside the bench took part ({name}): nothing is expected on C1." in scenario.about
    assert scenario.steps[-1].line == "expect TRCV_C_1 trace ..."
    assert main(["scenario", str(file)]) == 0
