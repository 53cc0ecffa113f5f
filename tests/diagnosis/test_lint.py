"""`trcvtui doctor P.toml`: a project is judged before its first scan."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from trcvtui.cli.main import main

ROOT = Path(__file__).parents[2]
HEAD = """
dialect = "baosky"
[[data]]
name = "rx"
type = "ARRAY[0..19] OF BYTE"
[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"
"""
INSTANCE = '[[instance]]\nname = "TRCV_C_1"\nblock = "TRCV_C"\nconnect = "C1"\ndata = "rx"\n'
MANY = "".join(
    f'[[connect]]\nname = "C{n}"\nLocalAddress = "127.0.0.1"\n'
    f'[[instance]]\nname = "T{n}"\nblock = "TRCV_C"\nconnect = "C{n}"\ndata = "rx"\n'
    for n in range(2, 12)
)

STREAM = (ROOT / "configs/twincat-stream.toml").read_text(encoding="utf-8")


def causes_of(text: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    path = folder / "p.toml"
    path.write_text(text)
    code = main(["doctor", str(path), "--format", "json"])
    (one,) = json.loads(capsys.readouterr().out)
    assert one["conversation"] is None and one["file"].endswith("p.toml")
    assert code == (0 if one["healthy"] else 1)
    return [finding["cause"] for finding in one["findings"]]


CALLS = HEAD + 'ActiveEstablished = true\nRemoteAddress = "127.0.0.1"\n'
PEER = '[[peer]]\nname = "P1"\nactive = true\nremote = "@C1"\n'
SIZES = 'says = ["random 7", "random 11", "random 4", "random 19"]\n'
PROJECTS = {
    "healthy": (HEAD + INSTANCE, ""),
    "LEN above DATA": (HEAD + INSTANCE + "LEN = 21\n", "limits"),
    "more connections than the model": ('model = "T3"\n' + HEAD + INSTANCE + MANY, "limits"),
    "no port to call": (CALLS + INSTANCE, "address"),
    "both active": (CALLS + "RemotePort = 2000\n" + INSTANCE + PEER, "address"),
    "a dead link shows after hours": (HEAD + "KeepAliveTimeInterval = 20000\n" + INSTANCE, "no-keep-alive"),
    "a sample is too short": (HEAD + INSTANCE + PEER + 'says = ["hex 01 02 03"]\n', "frame-short"),
    "samples have several sizes": (HEAD + INSTANCE + PEER + SIZES, "adhoc-missing"),
    "the suffix is another one": (
        STREAM + """says = ['text "AB 12.5\\r"', 'text "AC 3.5\\r"']\n""",
        "framing",
    ),
    "the suffix is right": (STREAM + """says = ['text "AB 12.5\\n"']\n""", ""),
}


@pytest.mark.parametrize("name", PROJECTS)
def test_what_is_wrong_is_told_before_the_first_scan(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, cause = PROJECTS[name]
    assert causes_of(text, tmp_path, capsys) == [cause] * bool(cause)


@pytest.mark.parametrize(
    ("project", "cause"),
    [
        ("configs/stories/byte_order_swapped.toml", "byte-order"),
        ("configs/stories/four_bytes_short.toml", "frame-short"),
        ("configs/udt-mismatch.toml", "padding"),
        ("configs/checkweigher.toml", None),
        ("configs/stories/en_r_dropped.toml", None),
    ],
)
def test_the_first_finding_of_a_story_is_its_verdict(
    project: str, cause: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["doctor", str(ROOT / project), "--format", "json"])
    (one,) = json.loads(capsys.readouterr().out)
    assert (one["findings"][0]["cause"] if one["findings"] else None) == cause


def test_a_project_runs_for_some_time_and_its_traffic_is_judged(capsys: pytest.CaptureFixture[str]) -> None:
    project = str(ROOT / "configs/stories/en_r_dropped.toml")
    assert main(["doctor", project, "--for", "T#8s", "--kernel", "sim", "--format", "json"]) == 1
    lint, run = json.loads(capsys.readouterr().out)
    assert lint["conversation"] is None and lint["healthy"]
    assert run["file"].endswith("en_r_dropped.toml") and run["conversation"]["protocol"] == "tcp"
    assert run["findings"][0]["cause"] == "shifted" and run["findings"][0]["t_s"] == pytest.approx(6.21)
