"""A report is one page of a recording: what happened, no byte of it as markup, the same page each time."""

from __future__ import annotations

import asyncio
import io
import json
import re
import shutil
import stat
from base64 import b64decode
from collections import Counter
from collections.abc import Iterable
from html.parser import HTMLParser
from pathlib import Path

import pytest

from tests.certificates import NEEDS_OPENSSL, Certificates
from tests.chromium import CHROMIUM, PATIENCE_S, chromium
from tests.replay.journals import InMemory, jsonl, on_the_screen, recorded
from tests.scenario.scenarios import CONFIGS, Kept
from trcvtui.bench.bench import Bench
from trcvtui.cli.main import main
from trcvtui.commands.words import SetInputs
from trcvtui.files import record_reads
from trcvtui.recording.journal import CallRecord, Entry, decode_entries, encode_blocks
from trcvtui.recording.recorder import RunRecorder
from trcvtui.report.command import recording_source, replay_with_notes
from trcvtui.report.page import generate_page
from trcvtui.report.run_notes import DONE, ERROR, MOST_COLUMNS, TimeLane
from trcvtui.scenario.report import JsonLines
from trcvtui.scenario.scenario import load_bench_project

SCENARIOS = CONFIGS / "scenarios"
SHORT_FRAME = SCENARIOS / "baosky" / "80a6-fin-mid-frame.toml"
TEXT = "<script>document.title='x'</script>&\u202e\x1b[31m"
SHOWN = "&lt;script&gt;document.title=&#39;x&#39;&lt;/script&gt;&amp;\\u202e\\x1b[31m"


class Elements(HTMLParser):
    """Counts the elements of a page; each that is opened has to be closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.found: Counter[str] = Counter()
        self.attributes: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found[tag] += 1
        self.attributes.update(name for name, _ in attrs)
        if tag != "meta":
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found[tag] += 1

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def elements(text: str) -> Elements:
    parser = Elements()
    parser.feed(text)
    assert not parser.open
    return parser


def told(entries: Iterable[Entry], has_payload: bool = True) -> str:
    run, notes, verdict, stopped = replay_with_notes(
        InMemory(tuple(decode_entries(encode_blocks(entries), "R"))), "R", has_payload
    )
    return "".join(generate_page(recording_source(run, notes, verdict, stopped, "R", "00"), notes, verdict))


def plain(text: str) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", text))


def recording(folder: Path, scenario: Path = SHORT_FRAME, *options: str) -> Path:
    file = folder / "R.pcapng"
    main(["scenario", str(scenario), "--record", str(file), *options])
    return file


def hostile(folder: Path) -> Path:
    """Return a scenario whose name, text and bytes are markup."""
    (folder / "T.st").write_text("TYPE T : STRUCT text : STRING[60]; END_STRUCT END_TYPE")
    (folder / "P.toml").write_text(
        'dialect = "baosky"\n[[udt]]\nfile = "T.st"\n'
        '[[data]]\nname = "rx"\ntype = "T"\n'
        '[[connect]]\nname = "C1"\nLocalAddress = "127.0.0.1"\n'
        '[[instance]]\nname = "R1"\nblock = "TRCV_C"\nconnect = "C1"\ndata = "rx"\n'
        '[[peer]]\nname = "P1"\nactive = true\nremote = "@C1"\n'
    )
    scenario = folder / "S.toml"
    name = TEXT.replace("\x1b", "\\u001b")
    scenario.write_text(
        f'project = "P.toml"\n[scenario]\nname = "{name}"\nsteps = """\n'
        "set R1 CONT=1 EN_R=1\nwait R1 STATUS=7002\npeer P1 connect\nwait R1 STATUS=7006\n"
        'peer P1 send udt T {text=\'<img src=x onerror=y>\'}\nwait R1 DONE=1\n"""\n'
    )
    return scenario


# -- what stands on it -----------------------------------------------------------------------------------


def test_an_error_is_told_with_its_scan_its_cause_and_what_to_check() -> None:
    _, entries = recorded(SHORT_FRAME)
    said = plain(told(entries))
    assert "passed, 2 ERRORs at 1 instance" in said
    assert "16#80A6 Frame ended too early (static mode) in scan 8, 0.070 s" in said
    assert "messages had 5 bytes, but a frame has 8; missing: 3 bytes" in said
    assert "8 0.070 16#80A6 short frame ERROR the partner closed (recv gave 0 bytes), 5 of 8 bytes" in said
    assert "job 1, received 5 B, scan 8, 0.070 s FIN 00000000 01 02 03 04 05" in said
    assert "5 0.040 command peer P1 send hex 01 02 03 04 05" in said


def test_frames_stand_there_with_their_members_and_those_that_were_dropped() -> None:
    _, entries = recorded(SCENARIOS / "stories" / "en-r-dropped.toml")
    said = plain(told(entries))
    assert "TRCV_C_1 TRCV_C C1 16#7008 Frame received scan 901 8 1 0" in said
    assert "job 1, received 24 B, scan 101, 1.000 s 00000000 65 00 00 00 00 00 20 40" in said
    assert "byte type carton value 0 DINT number 101 4 REAL weight 2.5" in said


REMARKS = {
    "byte-order-swapped": "in scan 53, 0.520 s .* members look swapped: voltage = 230.5",
    "en-r-dropped": "in scan 751, 7.500 s .* EN_R fell in scan 672 with 10 of 24 bytes",
    "four-bytes-short": "in scan 3051, 30.500 s .* LEN or DATA is 4 bytes too large for this sender",
    "packed-sender": "in scan 206, 2.050 s .* 10 bytes came: the size of Weight",
    "udt-mismatch": "in scan 23, 0.220 s .* 24 bytes came: the size of AxisReport",
}


@pytest.mark.parametrize("story", REMARKS)
def test_what_was_wrong_with_frames_on_the_way_is_told_although_no_error_came(story: str) -> None:
    _, entries = recorded(SCENARIOS / "stories" / f"{story}.toml")
    said = plain(told(entries))
    assert "passed, no ERROR, 1 remark on frames" in said
    assert re.search(REMARKS[story], said)


def test_sent_frames_and_an_expectation_that_failed_are_told(tmp_path: Path) -> None:
    scenario = tmp_path / "S.toml"
    project = CONFIGS / "passive-sender.toml"
    scenario.write_text(
        f'project = "{project}"\n[scenario]\nname = "S"\nsteps = """\nset TSEND_C_1 CONT=1\n'
        "wait TSEND_C_1 STATUS=7002\npeer P1 connect\nwait TSEND_C_1 STATUS=7004\npulse TSEND_C_1 REQ\n"
        'wait TSEND_C_1 DONE=1\nexpect TSEND_C_1 STATUS=7004\n"""\n'
    )
    _, entries = recorded(scenario)
    said = plain(told(entries))
    assert "FAILED: 1 expectation did not hold" in said
    assert "step 7: expect TSEND_C_1 STATUS=7004 found: " in said
    assert "job 1, sent " in said


def test_the_card_of_the_screen_is_on_the_page_and_without_payload_no_value_of_it() -> None:
    path = CONFIGS / "stories" / "byte_order_swapped.toml"
    _, entries = on_the_screen(path, "\n".join(["hold", "go"] * 15))
    said, without = plain(told(entries)), plain(told(entries, has_payload=False))
    for text in (said, without):
        assert "read DATA with byte_order=big" in text
    assert "the members make sense as big-endian" in without
    assert "voltage = 230.5" in said and "230.5" not in without


def test_the_lines_of_a_screen_and_its_settings_at_the_end_are_told() -> None:
    lines = "set TRCV_C_1 CONT=1 EN_R=1\nadd connect C9 LocalPort=2900\nhold"
    _, entries = on_the_screen(CONFIGS / "passive.toml", lines)
    said = plain(told(entries))
    assert "command add connect C9 ActiveEstablished=false LocalPort=2900" in said
    assert "[[connect]] name = &#34;C9&#34;" in said
    assert "run again from the recording, 10 scans: the same" in said
    at_the_end = said.partition("At the end: 16#7002")[2]
    assert "waiting for any partner since scan 3" in at_the_end, "the bench was looked at after its close"


def test_of_a_long_run_the_first_and_the_last_are_told_and_how_many_between() -> None:
    lines = "\n".join(["plc stop", "plc run"] * 100)
    _, entries = on_the_screen(CONFIGS / "active.toml", lines)
    text = told(entries)
    assert re.search(r"\d+ edges between are left out", text)
    assert re.search(r"\d+ events between are left out", text)
    assert len(text) < 200_000


def test_a_lane_holds_any_time_in_a_bounded_number_of_columns() -> None:
    lane = TimeLane(10)
    lane.set_state(0, 0)
    lane.set_state(50, DONE)
    lane.set_state(60, 0)
    lane.extend_to(90)
    assert lane.columns == [0] * 5 + [DONE] + [0] * 4
    lane.set_state(10**15, ERROR)
    assert len(lane.columns) <= MOST_COLUMNS
    assert lane.columns[0] == DONE and lane.columns[-1] == ERROR and not any(lane.columns[1:-1])


def test_scans_that_began_late_are_told_by_the_clock_and_not_what_follows_a_hold() -> None:
    kept, out = Kept(), io.StringIO()
    recorder = RunRecorder(lambda: kept, waits=False)
    path = CONFIGS / "stories" / "four_bytes_short.toml"
    with record_reads(recorder.reads):
        project = load_bench_project(path)
    with recorder:
        bench = Bench(project, "live", recorder.seam)
        recorder.add_header(bench, path, (), is_scenario=False)
        lines = JsonLines(out.write, bench.runtime.interval_ns, bench)
        for ms in (0, 10, 24, 50, 60, 99, 299, 309):
            if ms == 50:
                bench.do(SetInputs("TRCV_C_1", (("EN_R", 1),)))
            if ms == 299:
                bench.step_peers_alone()
            bench.step(ms * 1_000_000)
            lines.write_scan(bench.runtime.scans, bench.runtime.changed)
            recorder.finish_scan(bench)
        bench.close()
    records = [json.loads(line) for line in out.getvalue().splitlines()]
    assert [(r["scan"], r["t_ms"], r["at"], r.get("late_ms"), r["STATUS"]) for r in records] == [
        (1, 0.0, 0.0, None, "0001"),
        (2, 10.0, 0.01, None, "7001"),
        (3, 20.0, 0.024, None, "7002"),
        (4, 30.0, 0.05, 16.0, "80A1"),
        (5, 40.0, 0.06, None, "7002"),
    ]
    assert bench.late_scans == 2
    assert jsonl(kept.entries) == out.getvalue()
    assert "late 2 scans by more than half an interval: 4 (16.0 ms), 6 (29.0 ms) " in plain(
        told(kept.entries)
    )


# -- what it never is ------------------------------------------------------------------------------------


def test_no_byte_of_a_wire_and_no_name_is_markup(tmp_path: Path) -> None:
    _, entries = recorded(hostile(tmp_path))
    text = told(entries)
    found = elements(text)
    assert SHOWN in text and "&lt;img src=x onerror=y&gt;" in text
    assert not {"script", "img", "link", "a", "iframe", "object"} & found.found.keys()
    assert not {"src", "href", "style", "onload", "onerror"} & found.attributes
    assert all(character.isprintable() or character == "\n" for character in text)
    assert str(tmp_path) not in text and "http" not in text.replace("http-equiv", "")


def test_the_same_recording_gives_the_same_page_wherever_it_lies(tmp_path: Path) -> None:
    file = recording(tmp_path)
    other = tmp_path / "other"
    other.mkdir()
    copied = Path(shutil.copy(file, other))
    pages = []
    for each in (file, file, copied):
        out = each.parent / "X.html"
        assert main(["report", str(each), "--out", str(out)]) == 0
        pages.append(out.read_bytes())
    assert pages[0] == pages[1] == pages[2]


@pytest.mark.parametrize("name", ["stories/packed-sender", "stories/auto-reply", "baosky/80a6-fin-mid-frame"])
def test_without_payload_no_byte_that_came_is_on_the_page(name: str) -> None:
    _, entries = recorded(SCENARIOS / f"{name}.toml")
    came = {
        entry.answer[1][:8]
        for entry in entries
        if isinstance(entry, CallRecord) and isinstance(entry.answer, tuple) and entry.call == "recv"
        if isinstance(entry.answer[1], bytes) and len(entry.answer[1]) > 3
    }
    with_all, without = told(entries), told(entries, has_payload=False)
    elements(without)
    assert came
    for data in came:
        assert data.hex(" ")[:23] in with_all.replace("  ", " ")
        assert data.hex(" ") not in without.replace("  ", " ") and data.hex() not in without


@NEEDS_OPENSSL
def test_keys_and_tls_secrets_are_never_on_the_page(
    secure_bench: Path, certificates: Certificates, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = recording(tmp_path, secure_bench / "tls-server.toml")
    out = tmp_path / "X.html"
    assert main(["report", str(file), "--out", str(out)]) == 0
    assert "R.pcapng holds TLS secrets" in capsys.readouterr().err
    text = out.read_text()
    assert "BEGIN" not in text and "plc.key" in text
    secrets = re.findall(rb"(?:CLIENT|SERVER|EXPORTER)_[A-Z_0-9]+ ([0-9a-f]+) ([0-9a-f]+)", file.read_bytes())
    assert secrets
    assert not any(secret.decode() in text for pair in secrets for secret in pair)


@NEEDS_OPENSSL
def test_no_folder_is_on_the_page_not_in_settings_and_commands_either(
    secure_bench: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "R&D of Meier"
    shutil.copytree(secure_bench, folder)
    scenario, out = folder / "tls-server.toml", tmp_path / "X.html"
    added = f"add certificate 9 file='{folder / 'certificates' / 'ca.pem'}'\nremove certificate 9\n"
    text = scenario.read_text().replace('steps = """\n', f'steps = """\n{added}')
    scenario.write_text(text.replace('"certificates/plc', f'"{folder}/certificates/plc'))
    file = recording(tmp_path, scenario)
    assert main(["report", str(file), "--out", str(out)]) == 0
    page = out.read_text()
    assert "plc.key" in page and not re.search("Meier|R&amp;D|certificates/", page)
    assert "add certificate 9 file=&#39;ca.pem&#39;" in plain(out.read_text())


# -- the command -----------------------------------------------------------------------------------------


def test_a_recording_that_was_cut_is_told_as_far_as_it_goes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = recording(tmp_path, SCENARIOS / "stories" / "en-r-dropped.toml"), tmp_path / "X.html"
    file.write_bytes(file.read_bytes()[:30_001])
    capsys.readouterr()
    assert main(["report", str(file), "--out", str(out)]) == 1
    [line] = capsys.readouterr().err.splitlines()
    assert re.search(r"R.pcapng: byte \d+: found the end of the file, expected the rest of a block", line)
    said = plain(out.read_text())
    assert "only 450 scans of the run could be run again: R.pcapng: byte " in said
    assert "up to scan 450: no ERROR" in said and "In scan" not in said
    assert "job 5, received 24 B, scan 501" not in said and "job 4, received 24 B, scan 401" in said


@NEEDS_OPENSSL
def test_of_a_recording_without_secrets_the_outputs_are_told_as_its_journal_says(
    secure_bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = recording(tmp_path, secure_bench / "tls-server.toml", "--no-secrets"), tmp_path / "X.html"
    capsys.readouterr()
    assert main(["report", str(file), "--out", str(out)]) == 1
    assert "--no-secrets: it can be viewed, not replayed" in capsys.readouterr().err
    said = plain(out.read_text())
    assert (
        "up to scan 552: 9 ERRORs at 1 instance" in said
        and "scans 1 to 552 are known only from the journal" in said
    )
    assert "541 5.400 16#80E1" in said and "In scan 0" not in said


def test_a_run_that_goes_on_otherwise_is_told_as_the_journal_says_from_there_on() -> None:
    _, entries = recorded(SHORT_FRAME)
    at = next(
        n for n, one in enumerate(entries) if isinstance(one, CallRecord) and one.args[1:2] == (0x7006,)
    )
    one = entries[at]
    assert isinstance(one, CallRecord)
    said = plain(told([*entries[:at], one._replace(args=("C1", 0x7001, *one.args[2:])), *entries[at + 1 :]]))
    assert "up to scan 12: 2 ERRORs at 1 instance" in said
    assert "only 5 scans of the run could be run again: R: scan 5: found shows (" in said
    assert "scans 6 to 12 are known only from the journal" in said and "In scan 5: 16#7006" in said
    assert "8 0.070 16#80A6 ERROR" in said


def test_a_report_is_written_for_its_owner_alone_and_replaces_nothing_but_a_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out, other = recording(tmp_path), tmp_path / "X.html", tmp_path / "other.html"
    other.write_text("<!doctype html>")
    for _ in range(2):
        assert main(["report", str(file), "--out", str(out)]) == 0
    assert stat.S_IMODE(out.stat().st_mode) == 0o600
    before, capture = other.read_bytes(), file.read_bytes()
    capsys.readouterr()
    for target in (other, file, tmp_path, tmp_path / "no" / "X.html"):
        assert main(["report", str(file), "--out", str(target)]) == 2
        [line] = capsys.readouterr().err.splitlines()
        assert line.startswith(f"--out {target}: found ")
    assert other.read_bytes() == before and file.read_bytes() == capture
    assert main(["report", str(out), "--out", str(tmp_path / "Y.html")]) == 2
    assert (
        "expected a capture: pcapng or pcap" in capsys.readouterr().err and not (tmp_path / "Y.html").exists()
    )


# -- of a capture ----------------------------------------------------------------------------------------


def test_a_capture_is_told_as_its_shadows_show_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = recording(tmp_path, SCENARIOS / "stories" / "en-r-dropped.toml"), tmp_path / "X.html"
    project = str(CONFIGS / "stories" / "en_r_dropped.toml")
    words = ["report", str(file), "--out", str(out), "--plc", "127.0.0.1:32768", "--project", project]
    assert main(words) == 0
    said = plain(out.read_text())
    assert "a capture, played to shadow instances" in said and "PLC end" in said
    assert "16#7008 Frame received in scan 701, 7.000 s" in said and "stream is shifted" in said
    assert "C1 tcp 127.0.0.1:32768 127.0.0.1:32769 syn rst-plc 178 0 0 C1" in said
    assert "0 DINT number 101 4 REAL weight 2.5" in said
    before = out.read_bytes()
    assert main(words) == 0 and out.read_bytes() == before


def test_a_capture_whose_conversations_are_of_another_plc_is_no_report_without_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = recording(tmp_path, SCENARIOS / "stories" / "en-r-dropped.toml"), tmp_path / "X.html"
    sender = str(CONFIGS / "sender.toml")  # it receives nothing
    for words in (["--plc", "127.0.0.9"], ["--plc", "127.0.0.1:32768", "--project", sender]):
        assert main(["report", str(file), "--out", str(out), *words]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert "one of the ends in the capture: 127.0.0.1:32768, 127.0.0.1:32769" in line and not out.exists()


def test_a_copy_to_hand_on_is_a_capture_with_shadows_of_its_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, copy, out = recording(tmp_path), tmp_path / "C.pcapng", tmp_path / "X.html"
    assert main(["recording", "strip", str(file), str(copy), "--no-payload"]) == 0
    copy.write_bytes(copy.read_bytes()[:-7])
    capsys.readouterr()
    assert main(["report", str(copy), "--out", str(out), "--no-payload"]) == 0
    assert "only the packets before that are read" in capsys.readouterr().err
    text = out.read_text()
    assert "C1_TO_PLC" in plain(text) and "5 of 8" not in plain(text)
    assert not {"script", "img"} & elements(text).found.keys()


# -- in a browser ----------------------------------------------------------------------------------------

COLOURS = (
    ("screen", "light", "rgb(255, 255, 255)"),
    ("screen", "dark", "rgb(18, 22, 26)"),
    ("print", "dark", "rgb(255, 255, 255)"),
)


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium")
async def test_a_browser_runs_nothing_of_it_shows_it_dark_and_light_and_prints_it_on_a4(
    tmp_path: Path,
) -> None:
    file, out = recording(tmp_path, hostile(tmp_path)), tmp_path / "X.html"
    assert main(["report", str(file), "--out", str(out)]) == 0
    number = sum(elements(out.read_text()).found.values())
    async with chromium(tmp_path, out.as_uri()) as tab, asyncio.timeout(PATIENCE_S):
        while not await tab.is_true("location.protocol == 'file:' && document.readyState == 'complete'"):
            await asyncio.sleep(0.05)
        assert await tab.is_true("document.title.startsWith('<script>')"), "a script has run"
        assert await tab.is_true(f"document.querySelectorAll('*').length == {number}")
        assert await tab.is_true("document.querySelector('path.done').getBBox().width > 2")
        for media, scheme, colour in COLOURS:
            features = [{"name": "prefers-color-scheme", "value": scheme}]
            await tab.ask("Emulation.setEmulatedMedia", media=media, features=features)
            assert await tab.is_true(f"getComputedStyle(document.body).backgroundColor == '{colour}'")
        await tab.ask(
            "Emulation.setDeviceMetricsOverride", width=700, height=900, deviceScaleFactor=1, mobile=False
        )
        assert await tab.is_true("document.documentElement.scrollWidth <= 700"), "wider than paper"
        paper = b64decode((await tab.ask("Page.printToPDF", preferCSSPageSize=True))["data"])
    boxes = re.findall(rb"/MediaBox *\[0 0 ([\d.]+) ([\d.]+)\]", paper)
    assert boxes and {(round(float(w)), round(float(h))) for w, h in boxes} == {(595, 842)}
