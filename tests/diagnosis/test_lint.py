"""`trcvtui doctor P.toml`: a project is judged before its first scan."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from trcvtui.bench.bench import Bench
from trcvtui.cli.main import main
from trcvtui.commands import words
from trcvtui.project.file import load_project

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
RECEIVER = INSTANCE + "CONT = true\nEN_R = true\n"
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
    "nothing sets CONT": (HEAD + INSTANCE + "EN_R = true\n", "not-connected-request"),
    "nothing sets the CONT of a sender": (
        'start = "pulse TSEND_C_1 REQ"\n' + HEAD + INSTANCE.replace("TRCV", "TSEND"),
        "not-connected-request",
    ),
    "the program sets CONT": ('program = "pulse TRCV_C_1 CONT"\n' + HEAD + INSTANCE + "EN_R = true\n", ""),
    "EN_R builds the connection": (HEAD.replace("baosky", "s7-1200") + INSTANCE + "EN_R = true\n", ""),
    "two receivers take turns": (
        'program = "set TRCV_C_1 EN_R=0"\n' + HEAD + RECEIVER + RECEIVER.replace("C_1", "C_2"),
        "",
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


OTHER = '[[connect]]\nname = "C2"\nLocalAddress = "127.0.0.1"\n{}' + RECEIVER.replace("C_1", "C_2").replace(
    '"C1"', '"C2"'
)
ACTIVE = 'ActiveEstablished = true\nRemoteAddress = "127.0.0.1"\n'
# What the evidence names; the STATUS is asked of the bench.
REFUSED = {
    "a T-selector of rack and slot": (
        "s7-1200",
        'type = "TCON_IP_RFC"\nLocalTSelector = "E0.03"\n',
        "TCON_IP_RFC.LocalTSelector begins at byte 46 of C1 and holds 00 02 e0 03",
    ),
    "no RemotePort": ("s7-1500", ACTIVE, "RemotePort"),
    "an ID that is too large": ("s7-1500", "ID = 5000\nLocalPort = 2000\n", "ID"),
    "a port of the system": ("s7-1500", "LocalPort = 161\n", "LocalPort begins at byte"),
    "a name without its dot": (
        "s7-1500",
        'type = "TCON_QDN"\nActiveEstablished = true\nRemoteQDN = "scale"\nRemotePort = 2000\n',
        "RemoteQDN",
    ),
    "UDP without ADDR": (
        "s7-1500",
        'type = "TCON_IP_v4"\nConnectionType = 19\nLocalPort = 2000\n',
        "ADDR",
    ),
    "an address of no port": ("baosky", "", "0.0.0.0 names no port of the PLC"),
    "an ID twice": (
        "s7-1500",
        "ID = 7\nLocalPort = 2000\n" + RECEIVER + OTHER.format("ID = 7\nLocalPort = 2001\n"),
        "ID 7 is that of C1",
    ),
    "a port that another one listens on": (
        "s7-1500",
        "LocalPort = 2000\n" + RECEIVER + OTHER.format("LocalPort = 2000\n"),
        "127.0.0.1:2000",
    ),
    "TCON alone": (
        "s7-1500",
        'type = "TCON_IP_v4"\nLocalPort = 161\n'
        + INSTANCE.replace("TRCV_C", "TCON").replace('data = "rx"\n', ""),
        "LocalPort begins at byte",
    ),
    "a receiver beside another one": (
        "baosky",
        'LocalAddress = "127.0.0.1"\n' + RECEIVER + RECEIVER.replace("C_1", "C_2") + PEER,
        "TRCV_C_1 and TRCV_C_2 both receive on C1",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_block_will_refuse_is_found_before_with_the_status_that_it_shows(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dialect, text, evidence = REFUSED[name]
    head = HEAD.replace("baosky", dialect)
    head = head if dialect != "baosky" else head.replace('LocalAddress = "127.0.0.1"\n', "")
    path = tmp_path / "p.toml"
    path.write_text(head + text + ("" if "[[instance]]" in text else RECEIVER))
    assert main(["doctor", str(path), "--format", "json"]) == 1
    (judged,) = json.loads(capsys.readouterr().out)
    (found,) = judged["findings"]
    assert evidence in "; ".join(found["evidence"])
    bench = Bench(load_project(path), "sim")
    shown = set()
    for scan in range(20):
        if scan == 8 and PEER in text:
            bench.do(words.PeerAction("P1", "connect"))
        if scan == 1 and '"TCON"' in text:
            bench.do(words.SetInputs("TCON_1", (("REQ", True),)))
        bench.step()
        shown |= {
            f"{edge.outputs.status:04X}"
            for edge in bench.runtime.changed
            if edge.instance == found["where"]["instance"] and edge.outputs.error
        }
    bench.close()
    assert found["status"] and set(found["status"]) <= shown


CALLER = ACTIVE + "LocalPort = 2000\nRemotePort = 2001\n"
FREE = CALLER.replace("2000", "0")
LISTENER = "LocalPort = 2000\n"
DATAGRAMS = 'type = "TCON_IP_v4"\nConnectionType = 19\nLocalPort = 2000\n'
TWICE = {
    "two that call": (CALLER, CALLER, [("address", 0.5, ["80A1"])]),
    "two that call from any port": (FREE, FREE, []),
    "one that calls, one that listens": (CALLER, LISTENER, [("address", 0.95, ["80A1"])]),
    "two that listen elsewhere on the bench": (
        LISTENER + "ListenPort = 0\n", LISTENER + "ListenPort = 0\n", [("address", 0.5, ["80A1"])]
    ),
    "two of UDP": (DATAGRAMS, DATAGRAMS, [("address", 0.95, ["80A1"])]),
    "TCP beside UDP": (LISTENER, DATAGRAMS, []),
    "two of ISO-on-TCP": ('type = "TCON_IP_RFC"\nLocalTSelector = "E0.01"\nIsoPort = 0\n',) * 2 + ([],),
    "one ID": (LISTENER + "ID = 7\n", "LocalPort = 2001\nID = 7\n", [("limits", 0.95, ["80C8"])]),
}  # fmt: skip


@pytest.mark.parametrize("name", TWICE)
def test_one_id_or_one_local_port_of_two_connects_is_found(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second, found = TWICE[name]
    path = tmp_path / "p.toml"
    tcon = INSTANCE.replace("TRCV_C", "TCON").replace('data = "rx"\n', "")
    others = OTHER.partition("[[instance]]")[0].format(second)
    text = HEAD.replace("baosky", "s7-1500") + first + others + tcon
    path.write_text(text + tcon.replace("TCON_1", "TCON_2").replace('"C1"', '"C2"'))
    assert main(["doctor", str(path), "--format", "json"]) == bool(found)
    (judged,) = json.loads(capsys.readouterr().out)
    assert [(one["cause"], one["confidence"], one["status"]) for one in judged["findings"]] == found


def test_a_local_port_of_two_explains_no_other_status(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, anywhere = tmp_path / "p.toml", 'LocalAddress = "0.0.0.0"'
    text = HEAD + LISTENER + RECEIVER + OTHER.format(LISTENER)
    path.write_text(text.replace('LocalAddress = "127.0.0.1"', anywhere))
    assert main(["doctor", str(path), "--for", "T#1s", "--kernel", "sim", "--format", "json"]) == 1
    found = [row for one in json.loads(capsys.readouterr().out) for row in one["findings"]]
    said = {(row["cause"], *row["status"], bool(row["explains"])) for row in found}
    assert said == {("address", "8083", False), ("block-error", "8081", True)}


def test_one_id_is_found_where_no_block_uses_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = HEAD.replace("baosky", "s7-1500") + LISTENER + "ID = 7\n" + RECEIVER
    unused = OTHER.partition("[[instance]]")[0].format("LocalPort = 2001\nID = 7\n")
    assert causes_of(text + unused, tmp_path, capsys) == ["limits"]


def test_the_remedy_of_a_missing_cont_takes_the_finding_away(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "p.toml"
    path.write_text(HEAD + INSTANCE + "EN_R = true\n")
    main(["doctor", str(path), "--format", "json"])
    (finding,) = json.loads(capsys.readouterr().out)[0]["findings"]
    (mend,) = finding["mend"]
    assert mend["command"] == "set TRCV_C_1 CONT=1"
    assert main(["doctor", str(path), "--set", mend["set"]]) == 0


SYMBOLIC = """
dialect = "s7-1200"
[[data]]
name = "rx"
type = "ARRAY[0..9] OF INT"
optimized = true
[[connect]]
name = "C1"
type = "TCON_IP_v4"
ID = 1
ConnectionType = 11
ActiveEstablished = true
LocalAddress = "127.0.0.1"
RemoteAddress = "127.0.0.1"
RemotePort = "@P1"
[[instance]]
name = "R"
block = "TRCV_C"
connect = "C1"
data = "rx"
ADHOC = true
[[peer]]
name = "P1"
active = false
"""
SELECTORS = """
dialect = "s7-1500"
[[data]]
name = "rx"
type = "ARRAY[0..9] OF BYTE"
[[connect]]
name = "C1"
type = "TCON_IP_RFC"
ActiveEstablished = true
LocalAddress = "127.0.0.1"
RemoteAddress = "127.0.0.1"
LocalTSelector = "E0.02"
RemoteTSelector = "E0.03"
IsoPort = "@P1"
[[instance]]
name = "R"
block = "TRCV_C"
connect = "C1"
data = "rx"
[[peer]]
name = "P1"
active = false
iso = true
local_tsap = "E0.0{}"
remote_tsap = "E0.02"
"""


@pytest.mark.parametrize(
    ("text", "status"),
    [
        (SYMBOLIC, "8088"),
        (SYMBOLIC.replace("OF INT", "OF BYTE"), ""),
        (SELECTORS.replace("{}", "7"), "80C5"),
        (SELECTORS.replace("{}", "3"), ""),
        (CALLS + "RemotePort = 2000\n" + INSTANCE, ""),  # its partner is not in the project
    ],
    ids=["a refused job", "DATA of bytes", "TSAPs that do not fit", "TSAPs that fit", "no partner here"],
)
def test_a_dry_run_of_three_seconds_finds_what_blocks_refuse(
    text: str, status: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "p.toml"
    path.write_text(text)
    assert main(["doctor", str(path), "--format", "json"]) == bool(status)
    (one,) = json.loads(capsys.readouterr().out)
    assert [code for finding in one["findings"] for code in finding["status"]] == [status] * bool(status)
    assert all(finding["mend"] for finding in one["findings"])
