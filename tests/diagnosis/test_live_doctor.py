"""The doctor on a bench that runs: causes within 10 s of traffic, the stories' verdicts, answers to lines."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from tests.bench.bench_lines import do
from tests.diagnosis.truth.cases import ISO, ISO_PEER, pins, plc, receiver, sender, udp_receiver
from tests.scenario.scenarios import CONFIGS
from trcvtui import clock
from trcvtui.bench.bench import Bench
from trcvtui.bench.doctor_requests import BenchDoctor, read_result
from trcvtui.cli.main import main
from trcvtui.diagnosis.doctor_process import DoctorWorker, judge_run
from trcvtui.diagnosis.judges import JUDGE_ENTRY, FilesJudge
from trcvtui.engine.controller import fresh_bench
from trcvtui.engine.driver import EngineDriver
from trcvtui.errors import mistake
from trcvtui.files import record_reads
from trcvtui.net.serial_line import SimSerialPort
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.recording.files import RecordTarget
from trcvtui.recording.recorder import make_recorder
from trcvtui.recording.worker_process import PendingAnswer
from trcvtui.replay.driver import WORK_SLICE_NS, open_time_line
from trcvtui.replay.job_facts import collect_recorded_facts
from trcvtui.scenario.scenario import load_bench_project
from trcvtui.snapshots.doctor import DoctorSnapshot
from trcvtui.udt.layout.values import decode

ENDS = 'LocalAddress = "127.0.0.1"\n', "LocalPort = 2000\n"
CALLS = f'ActiveEstablished = true\n{ENDS[0]}RemoteAddress = "127.0.0.1"\nRemotePort = 2000\n'
EIGHT = 'every = "T#100ms"\nsays = ["hex 01 02 03 04 05 06 07 08"]'
# A length field, and four REALs.
REALS = """every = "T#200ms"
says = [
    "hex 00 10 00 00 A4 41 00 00 A0 3F 00 00 96 43 00 00 00 3F",
    "hex 00 10 00 00 A8 41 00 00 A0 3F 00 80 96 43 00 00 00 3F",
    "hex 00 10 00 00 AC 41 00 00 A0 3F 00 00 97 43 00 00 00 3F",
]"""
STREAM = (CONFIGS / "twincat-stream.toml").read_text(encoding="utf-8")  # cut at LF
LISTENER = 'local = "127.0.0.1:2000"\n'


def received(last: int, peer: str, **inputs: object) -> str:
    own = receiver("TRCV_C", last + 1, pins(CONT=True, EN_R=True, **inputs))
    return plc("".join(ENDS), own, 'active = true\nremote = "@C1"\nreconnect = "T#200ms"\n' + peer)


def sent(last: int, peer: str = "") -> str:
    return plc(CALLS, sender(last + 1), peer)


OTHER_TSAP = ISO_PEER.replace("E0.01", "E0.77")
UDP_PEER = 'udp = true\nremote = "@U1"\nevery = "T#200ms"\nsays = ["hex 01 02 03 04 05 06 07 08"]'


def each(times: int, *steps: tuple[int, str]) -> list[tuple[int, str]]:
    return list(steps) * times


# Cause, project, lines and the scans that pass before each.
CASES: list[tuple[str, str, list[tuple[int, str]]]] = [
    ("frame-short", received(11, EIGHT), []),
    ("frame-long", received(4, EIGHT), []),
    (
        "adhoc-missing",
        received(39, 'every = "T#100ms"\nsays = ["random 7 seed=1", "random 12 seed=2", "random 31 seed=3"]'),
        [],
    ),
    (
        "adhoc-splits",
        received(39, 'every = "T#300ms"\nsays = ["random 30 seed=1 split=11 gap=T#30ms"]', ADHOC=True),
        [],
    ),
    (
        "merged",
        received(99, 'every = "T#300ms"\nsays = ["hex 0201020304", "hex 0201020304 0201020304"]', ADHOC=True),
        [],
    ),
    (
        "shifted",
        received(7, EIGHT),
        [(300, "peer P1 send hex 01 02 03")],
    ),
    ("flood", received(3, ""), [(60, "peer P1 send hex 01 02 03 04 repeat=9000 every=T#2ms")]),
    ("refused", sent(7), []),
    ("turned-away", sent(7, LISTENER), each(9, (104, "peer P1 rst"))),
    ("filtered", sent(7), [(0, "link C1 down")]),
    (
        "request-too-fast",
        "options.small_buffers = true\n" + sent(59999, LISTENER),
        [(50, "peer P1 stall"), *each(9, (9, "pulse S REQ"))],
    ),
    (
        "not-connected-request",
        sent(7).replace("ActiveEstablished = true\n", ""),
        [(50, "pulse S REQ"), (50, "pulse S REQ")],
    ),
    (
        "closes-each-message",
        received(7, ""),
        each(20, (30, "peer P1 send hex 01 02 03 04 05 06 07 08"), (5, "peer P1 close")),
    ),
    (
        "reconnect-storm",
        received(7, ""),
        each(20, (30, "peer P1 rst")),
    ),
    ("resets", received(7, EIGHT), [(300, "peer P1 send hex 01 02 03"), (5, "peer P1 rst")]),
    (
        "second-client",
        received(7, EIGHT) + '[[peer]]\nname = "P2"\nactive = true\nremote = "@C1"\nreconnect = "T#1s"\n',
        [],
    ),
    ("plc-not-reading", received(7, EIGHT), [(300, "set R EN_R=0")]),
    (
        "partner-not-reading",
        "options.small_buffers = true\n" + sent(59999, LISTENER),
        [(50, "peer P1 stall"), (9, "pulse S REQ")],
    ),
    ("dead-link", sent(7, LISTENER), [(50, "pulse S REQ"), (50, "link C1 down"), (9, "pulse S REQ")]),
    ("header", received(15, REALS).replace("ARRAY[0..15] OF BYTE", "ARRAY[0..3] OF REAL"), []),
    (
        "framing",
        STREAM,
        [
            (20, "peer P1 connect"),
            (20, "peer P1 send hex 3132333B"),
            *each(9, (30, "peer P1 send hex 35363B")),
        ],
    ),
    ("wrong-tsap", plc(ISO, receiver("TRCV_C", 8, pins(CONT=True, EN_R=True)), OTHER_TSAP, "s7-1500"), []),
    ("datagram-size", plc("", udp_receiver(4, "baosky", EN_R=True), UDP_PEER), []),
]


def after_ten_seconds(
    text: str,
    lines: list[tuple[int, str]],
    folder: Path,
    scans: int = 1000,
    values: dict[str, dict[str, object]] | None = None,
) -> DoctorSnapshot:
    """Return what is found in a run of 10 s on the simulated network; `values` gets those of DATA then."""
    project_file, file = folder / "p.toml", folder / "run.pcapng"
    project_file.write_text(text)
    recorder = make_recorder(RecordTarget(file), file, waits=True)
    with record_reads(recorder.reads):
        project = load_bench_project(project_file)
    with recorder:
        bench = fresh_bench(project, "sim", recorder.seam)
        recorder.add_header(bench, project_file, (), is_scenario=False)
        for wait, line in lines:
            _pass(bench, recorder, wait)
            do(bench, line)
        _pass(bench, recorder, scans - bench.runtime.scans)
        if values is not None:
            for decl in bench.project.data:
                paths = (leaf.path for leaf in decl.layout.leaves())
                shown = decode(decl.layout, bench.runtime.data(decl.name))
                values[decl.name] = dict(zip(paths, shown, strict=True))
        recorder.close()  # as a box has it: the run goes on
        bench.close()
    return judge_run(str(file), collect_recorded_facts)


def _pass(bench: Bench, recorder: Any, scans: int) -> None:
    for _ in range(scans):
        bench.step()
        recorder.finish_scan(bench)


@pytest.mark.parametrize(("cause", "text", "lines"), CASES, ids=[case[0] for case in CASES])
def test_ten_seconds_of_traffic_name_the_cause(
    cause: str, text: str, lines: list[tuple[int, str]], tmp_path: Path
) -> None:
    found = after_ten_seconds(text, lines, tmp_path).findings
    assert [one.cause for one in found][:1] == [cause], found


# Where no line of the bench mends it: what does.
NO_LINE_MENDS = {
    "flood": "the partner sends less, or the PLC scans faster",
    "refused": "the partner listens",
    "filtered": "a cable, a firewall",
    "request-too-fast": "the PLC's program",
    "not-connected-request": "the PLC's program",
    "closes-each-message": "the partner's program",
    "reconnect-storm": "the end that closes",
    "resets": "the end that resets",
    "turned-away": "the partner's other client, or its filter",
    "second-client": "one client more than the CONNECT takes",
    "partner-not-reading": "the partner reads",
    "dead-link": "a cable",
    "header": "the type of DATA, or the partner",
    "framing": "the bytes of prefix and suffix",
    "wrong-tsap": "the TSAP of one end",
}


def test_each_remedy_that_is_a_line_leaves_no_symptom(tmp_path: Path) -> None:
    """Type each line that a finding offers, let traffic go on for twenty seconds, and ask again."""
    tried, advised = [], []
    for number, (cause, text, lines) in enumerate(CASES):
        before, after = tmp_path / f"{number}-before", tmp_path / f"{number}-after"
        before.mkdir()
        after.mkdir()
        first = after_ten_seconds(text, lines, before).findings[0]
        remedies = [mend.command for mend in first.mend if mend.command]
        if not remedies:
            advised.append(cause)
            assert first.mend, cause
            continue
        tried.append(cause)
        left = 1000 - sum(wait for wait, _ in lines)
        applied = [*lines, *[(left if not n else 5, line) for n, line in enumerate(remedies)]]
        found = after_ten_seconds(text, applied, after, 3000).findings
        assert found == (), (cause, remedies, found)
    print(f"{len(tried)} causes with a remedy that was tried, {len(advised)} with advice alone")
    assert sorted(advised) == sorted(NO_LINE_MENDS)


def test_new_calls_on_the_same_ports_are_no_packets_that_got_lost(tmp_path: Path) -> None:
    """Numbers of a recording begin at 0 in each connection."""
    tsaps = plc(ISO, receiver("TRCV_C", 8, pins(CONT=True, EN_R=True)), OTHER_TSAP, "s7-1500")
    assert {one.cause for one in after_ten_seconds(tsaps, [], tmp_path).findings} == {"wrong-tsap"}


def test_errors_that_a_driver_counts_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = count(1)
    monkeypatch.setattr(SimSerialPort, "line_errors", lambda port: (0, 3 * next(asked), 0, 1))
    line = (CONFIGS / "twincat-line.toml").read_text(encoding="utf-8")
    text = line.replace('source = "sim"', 'source = "serial"\nport = "/dev/ttyS0"')
    found = after_ten_seconds(text, [(100, "feed RX hex 02 41 42")], tmp_path).findings
    assert [one.cause for one in found] == ["line-errors"]
    assert found[0].evidence == ("27 line errors in 3 bytes: parity 27",)


def test_what_the_project_says_is_found_where_the_traffic_does_not_show_it(tmp_path: Path) -> None:
    peer = 'active = true\nremote = "@C1"\nreconnect = "T#1s"\n'
    found = after_ten_seconds(sent(7, peer), [], tmp_path).findings
    assert {"refused", "address"} <= {one.cause for one in found}


@pytest.mark.parametrize(
    ("text", "lines"),
    [(received(7, EIGHT), []), (sent(7, LISTENER), [(50, "pulse S REQ")] * 9)],
    ids=["receives", "sends"],
)
def test_a_right_line_has_no_finding(text: str, lines: list[tuple[int, str]], tmp_path: Path) -> None:
    found = after_ten_seconds(text, lines, tmp_path)
    assert (found.conversations, found.findings) == (1, ())


def test_a_bench_that_runs_is_judged_by_its_pins_of_now(tmp_path: Path) -> None:
    """Its device sends in pieces: two messages after the remedy it accuses nothing any more."""
    says = 'every = "T#300ms"\nsays = ["hex 0100 0200 0300 0400 0500 0600 split=5 gap=T#40ms"]'
    text = received(5, says, ADHOC=True).replace("OF BYTE", "OF INT")
    (tmp_path / "before").mkdir()
    before = after_ten_seconds(text, [], tmp_path / "before", 500).findings
    assert [one.cause for one in before] == ["adhoc-splits"]
    remedy = str(before[0].mend[0].command)
    assert after_ten_seconds(text, [(500, remedy)], tmp_path, 575).findings == ()


def test_the_checkweigher_of_the_readme_is_found_to_pack_its_struct(tmp_path: Path) -> None:
    text = (CONFIGS / "checkweigher.toml").read_text(encoding="utf-8")
    report = "peer Device send hex 01 00 00 00 20 40 64 00 00 00"
    lines = [(10, "set TRCV_C_1 CONT=1 EN_R=1"), (10, "peer Device connect"), *[(50, report)] * 8]
    found = after_ten_seconds(text.replace('"types', f'"{CONFIGS}/types'), lines, tmp_path).findings
    assert found[0].cause == "padding"


@pytest.mark.parametrize(
    ("story", "data", "right"),
    [
        ("byte_order_swapped", "meter", {"serial": 10602, "state": 1, "phases": 3}),
        ("en_r_dropped", "carton", {"length": 400, "width": 300}),
        (
            "four_bytes_short",
            "screw",
            {"number": 4712, "angle": 391.0, "duration": 860, "program": 3, "tool": 0},
        ),
    ],
)
def test_after_the_remedies_of_a_story_its_values_are_right(
    story: str, data: str, right: dict[str, object], tmp_path: Path
) -> None:
    """Type each line that the doctor offers, as its card does, until it offers none."""
    text = (CONFIGS / "stories" / f"{story}.toml").read_text(encoding="utf-8")
    text = text.replace('"../types', f'"{CONFIGS}/types')
    lines: list[tuple[int, str]] = []
    scans = 1500
    for number in range(4):
        (tmp_path / str(number)).mkdir()
        values: dict[str, dict[str, object]] = {}
        found = after_ten_seconds(text, lines, tmp_path / str(number), scans, values).findings
        remedies = [mend.command for one in found[:1] for mend in one.mend if mend.command]
        if not remedies:
            break
        lines += [
            (5 if n else scans - sum(wait for wait, _ in lines), line) for n, line in enumerate(remedies)
        ]
        scans += 3600
    assert lines and found == ()
    assert {path: values[data][path] for path in right} == right


def scenario(folder: Path, *steps: str) -> Path:
    path = folder / "asked.toml"
    lines = "\n".join(steps)
    path.write_text(
        f'project = "{CONFIGS}/stories/four_bytes_short.toml"\n[scenario]\nname = "asked"\n'
        f'steps = """\n{lines}\n"""\n'
    )
    return path


@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_a_scenario_asks_the_doctor(kernel: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = scenario(
        tmp_path,
        "wait TRCV_C_1 STATUS=7006",
        "run T#1200ms",
        "doctor TRCV_C_1 frame-short",
        "doctor C1 healthy",
    )
    assert main(["scenario", str(path), "--kernel", kernel]) == 1
    told = capsys.readouterr().out
    assert "step 3: doctor TRCV_C_1 frame-short\n        frame-short (70% sure), TRCV_C_1\n" in told
    assert "[set TRCV_C_1 LEN=20]" in told
    assert "step 4: doctor C1 healthy\n        found: frame-short, expected healthy\n" in told


def test_a_recorded_scenario_that_asks_runs_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, file = scenario(tmp_path, "doctor healthy", "run 9"), tmp_path / "asked.pcapng"
    assert main(["scenario", str(path), "--record", str(file), "--format", "jsonl"]) == 0
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert last["told"] == [
        {"step": 1, "line": "doctor healthy", "told": ["healthy: 0 conversations looked at"]}
    ]
    assert main(["replay", str(file), "--check"]) == 0


def test_what_is_asked_wrongly_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenario", str(scenario(tmp_path, "doctor TRCV_C_1 4"))]) == 2
    assert "found '4', expected an instance, a CONNECT, a cause such as" in capsys.readouterr().err


MOST_LOOKS = 200
LOOKS = "the doctor looks …"


def told_by(ask: Callable[[int], object], picture: Callable[[], BenchUpdate | None], wanted: str) -> str:
    """Ask the doctor again and again until he tells it; return that."""
    for number in range(1, MOST_LOOKS):
        ask(number)
        while True:
            seen = picture()
            told = [each for each in seen.answers if each.message != LOOKS] if seen is not None else []
            if told:
                break
        assert told[0].error == "", told
        if wanted in told[0].message:
            return told[0].message
    raise AssertionError(f"{wanted} was never told")


@pytest.mark.parametrize("is_recorded", [False, True], ids=["black box", "--record"])
def test_the_engine_of_a_screen_names_a_short_frame_on_real_sockets(
    is_recorded: bool, tmp_path: Path
) -> None:
    path, file = tmp_path / "live.toml", tmp_path / "run.pcapng"
    path.write_text(received(11, EIGHT).replace("LocalPort = 2000", "LocalPort = 0"))
    driver = EngineDriver(path, "live", record=RecordTarget(file) if is_recorded else None)
    try:

        def picture() -> BenchUpdate | None:
            driver.request(UpdateRequest())
            return driver.poll_picture()

        told = told_by(lambda _: driver.submit("doctor R"), picture, "frame-short (95% sure), R")
        assert "have 8 bytes, but a job waits for 12" in told
    finally:
        driver.close()


def test_a_replay_is_judged_once_as_its_file_is_and_keys_go_to_what_is_found(tmp_path: Path) -> None:
    file = tmp_path / "run.pcapng"
    after_ten_seconds(received(11, EIGHT), [], tmp_path)
    line = open_time_line(file, None)

    def picture() -> BenchUpdate | None:
        line.advance(clock.now_ns() + WORK_SLICE_NS)
        return line.make_picture(UpdateRequest())

    for name, cause in (("R", "frame-short"), ("C1", "frame-short"), ("", "frame-short")):
        told = told_by(lambda number, name=name: line.handle_line(number, f"doctor {name}"), picture, cause)  # type: ignore[misc]
        assert told.startswith("frame-short (95% sure), R\n")
    assert line.controller._doctor.snapshot.looks == 1
    [scan] = line.survey.findings
    for number, (asked, there, note) in enumerate(
        (
            ("", line.survey.errors[0], line.survey.trouble),
            ("at error +1", scan, "finding: frame-short (J)"),
            ("at error +1", scan, "no later ERROR or finding"),
            ("at end", line.survey.last_scan, line.survey.trouble),
            ("at error -1", scan, "finding: frame-short (J)"),
        )
    ):
        if asked:
            line.handle_line(number, asked)
        while line.advance(clock.now_ns() + WORK_SLICE_NS):
            pass
        seen = picture()
        assert seen is not None and seen.position is not None
        assert (seen.position.scan, seen.position.note, seen.doctor.scan) == (
            there,
            note,
            line.survey.last_scan,
        )
    line.close()


def test_a_capture_is_judged_with_the_project_that_was_named(tmp_path: Path) -> None:
    after_ten_seconds(received(11, EIGHT), [], tmp_path)
    judge = FilesJudge(lambda: [str(tmp_path / "run.pcapng")], "127.0.0.1:2000", tmp_path / "p.toml")
    judge.start_judging()
    while judge.is_judging:
        judge.poll_process()
    assert json.loads(judge.result_json)["findings"][0]["cause"] == "frame-short"


def test_how_far_it_is_has_a_name_for_each_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    after_ten_seconds(received(11, EIGHT), [], tmp_path)
    told: list[str] = []
    monkeypatch.setattr(DoctorWorker, "_report", lambda _, text, at_once=False: told.append(text))
    judged = DoctorWorker(str(tmp_path / "answer"), collect_recorded_facts, load_bench_project)
    judged.add_block(json.dumps([[str(tmp_path / "run.pcapng")], None, None, None, False]).encode())
    judged.close()
    assert told[0].startswith("runs it again, scan 0 of ")
    assert told.index("reads run.pcapng: 0%") < told.index("judges run.pcapng")


def test_a_process_that_ends_half_way_has_found_nothing() -> None:
    answer = PendingAnswer(JUDGE_ENTRY)
    line = "reads a.pcap: 4%"
    for written, told in (
        (line.encode()[:9], ""),
        (line.encode() + b"\n", line),
        (b'{"conversations"', line),
    ):
        os.ftruncate(answer._file, 0)
        os.pwrite(answer._file, written, 0)
        assert answer.advance() is None and answer.progress == told
    answer.process._process.kill()
    answer.process.request_finish()
    while (content := answer.advance()) is None:
        pass
    project = load_bench_project(CONFIGS / "stories" / "four_bytes_short.toml")
    assert read_result(content, project, (), 1, 9).trouble == "the doctor's process has ended"


def test_files_that_are_gone_are_one_line(tmp_path: Path) -> None:
    judge = FilesJudge(lambda: [str(tmp_path / "none.pcapng")])
    judge.start_judging()
    while judge.is_judging:
        judge.poll_process()
    assert "none.pcapng: found 'No such file" in json.loads(judge.result_json)["trouble"]


class NoJudge:
    """A black box that has given up, or a machine without one more process."""

    result_json, progress, looks_again, is_judging = b"", "", True, False

    def __init__(self, why: Exception) -> None:
        self._why = why

    def start_judging(self) -> None:
        raise self._why

    def poll_process(self) -> None:
        return


@pytest.mark.parametrize(
    "why", [mistake("prompt", "no black box", "one"), OSError(24, "Too many open files")]
)
def test_a_doctor_that_cannot_look_is_trouble_in_a_picture_and_ends_no_bench(why: Exception) -> None:
    bench = fresh_bench(load_bench_project(CONFIGS / "active.toml"), "sim")
    doctor = BenchDoctor()
    assert [*doctor.advance(NoJudge(why), bench, is_wanted=True)] == []
    assert doctor.snapshot.looks == 1 and doctor.snapshot.trouble in str(why)
