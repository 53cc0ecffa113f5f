"""A recording of ours is judged with its own project, and with what its program did."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from trcvtui.capture.pcap import RAW_IP, interface_block, section_block
from trcvtui.cli.main import main
from trcvtui.paths import configs_path

ROOT = Path(__file__).parents[2]
SCENARIOS, DEMO = ROOT / "configs" / "scenarios", ROOT / "trcvtui" / "demo" / "demo.toml"


def judged(scenario: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    recording = folder / "run.pcapng"
    main(["scenario", str(SCENARIOS / scenario), "--record", str(recording)])
    capsys.readouterr()
    main(["doctor", str(recording), "--format", "json"])
    told = capsys.readouterr()
    assert "not read" not in told.err
    found: list[dict[str, Any]] = json.loads(told.out)
    return found


@pytest.mark.parametrize("scenario", ["baosky/7006-7008-static.toml", "baosky/7000-no-job.toml"])
def test_a_recording_of_a_good_run_is_healthy(
    scenario: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert all(one["healthy"] for one in judged(scenario, tmp_path, capsys))


def test_a_few_messages_of_several_lengths_are_not_given_the_len_of_one_of_them(
    capsys: pytest.CaptureFixture[str],
) -> None:
    project = str(configs_path() / "guide" / "barcode.toml")
    assert main(["doctor", project, "--for", "T#4s", "--kernel", "sim", "--format", "json"]) == 1
    found = [each for one in json.loads(capsys.readouterr().out) for each in one["findings"]]
    (short,) = [each for each in found if each["cause"] == "frame-short"]
    assert [mend.get("command") for mend in short["mend"]] == [None]


def test_the_demo_is_healthy_and_its_recording_knows_the_plc_end_of_each_conversation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """C1 listens, C2 calls; a copy without payload knows it, too."""
    demo = ["--kernel", "sim", "--duration", "T#4s"]
    assert main(["record", str(DEMO), "--out", str(tmp_path / "demo"), *demo]) == 0
    (file,) = map(str, (tmp_path / "demo").iterdir())
    assert main(["doctor", file]) == 0
    assert main(["doctor", str(DEMO), "--for", "T#4s", "--kernel", "sim"]) == 0
    assert main(["recording", "strip", file, str(tmp_path / "bare.pcapng"), "--no-payload"]) == 0
    capsys.readouterr()
    for each in (file, str(tmp_path / "bare.pcapng")):
        assert main(["conversations", each, "--format", "json"]) == 0
        guesses = [one["plc_guess"] for one in json.loads(capsys.readouterr().out)]
        assert [one["confidence"] for one in guesses] == [1.0, 1.0]


def test_a_fault_of_a_program_names_scan_and_instance(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = judged("baosky/note-req-during-7005.toml", tmp_path, capsys)
    where = next(f["where"] for one in found for f in one["findings"] if f["cause"] == "request-too-fast")
    assert where["scan"] > 1 and where["instance"]


@pytest.mark.parametrize(
    ("scenario", "cause", "status"),
    [
        ("baosky/80a0-refused.toml", "refused", "80A0"),
        ("baosky/udp-80aa-datagram-too-large.toml", "datagram-size", "80AA"),
        ("siemens/udp-80c9-too-long.toml", "datagram-size", "80C9"),
    ],
)
def test_a_finding_names_the_status_of_its_plc(
    scenario: str, cause: str, status: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = [one for each in judged(scenario, tmp_path, capsys) for one in each["findings"]]
    assert {word for one in found if one["cause"] == cause for word in one["status"]} == {status}


def test_a_report_shows_the_findings_first_and_no_bytes_without_payload(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    judged("stories/byte-order-swapped.toml", tmp_path, capsys)
    pages = []
    for name, options in (("a.html", []), ("b.html", ["--no-payload"])):
        out = tmp_path / name
        main(["report", str(tmp_path / "run.pcapng"), "--out", str(out), *options])
        pages.append(out.read_text(encoding="utf-8"))
    whole, without = pages
    assert 0 < whole.find("byte-order, 95% sure") < whole.find("<h2>")
    assert "voltage = 230" in whole and "byte-order, 95% sure" in without
    assert "voltage = 230" not in without


def first_finding(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any] | None:
    main(["doctor", *words, "--format", "json"])
    found = [one for each in json.loads(capsys.readouterr().out) for one in each["findings"]]
    return max(found, key=lambda one: float(one["confidence"]), default=None)


def test_the_story_of_the_night_and_of_the_colleague_have_one_verdict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    story = SCENARIOS / "stories" / "four-bytes-short.toml"
    night = str(tmp_path / "night.pcapng")
    main(["scenario", str(story), "--record", night])
    capsys.readouterr()
    project = str(SCENARIOS.parent / "stories" / "four_bytes_short.toml")
    of_the_night = first_finding(capsys, night)
    of_the_colleague = first_finding(capsys, night, "--project", project)
    for found in (of_the_night, of_the_colleague):
        assert found is not None and found["cause"] == "frame-short"
        assert found["mend"][0]["set"] == "instance.TRCV_C_1.LEN=20"


def test_what_is_set_on_a_capture_of_others_needs_a_project(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capture = tmp_path / "night.pcapng"
    capture.write_bytes(section_block("others") + interface_block(RAW_IP, "eth0"))
    assert main(["doctor", str(capture), "--set", "instance.TRCV_C_1.LEN=20"]) == 2
    assert capsys.readouterr().err == (
        f"--set: found {capture}, a capture, expected a recording, or --project with the capture\n"
    )
