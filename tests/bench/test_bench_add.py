"""`add`: one more instance, CONNECT, DATA, peer, message of a running bench, as good as one of the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bench.bench_project import bench_project
from tests.scenario.scenarios import CONFIGS, failures, play
from trcvtui.commands.reader import after
from trcvtui.commands.table import parse_line, to_line
from trcvtui.errors import UserError
from trcvtui.project.project import Project

KERNELS = pytest.mark.parametrize("kernel", ["sim", "live"])
EMPTY = 'dialect = "baosky"\n[scenario]\nsteps = """\n{steps}\n"""\n'
FROM_NOTHING = """
run 3
add connect C9 LocalAddress=127.0.0.1
add data rx9 ARRAY[0..3] OF BYTE
add instance R9 block=TRCV_C connect=C9 data=rx9 CONT=1 EN_R=1
wait R9 STATUS=7002 within T#2s
add peer P9 remote=@C9
run 2
peer P9 connect
wait R9 STATUS=7006 within T#5s
add message four hex 01 02 03 04
peer P9 send message four
expect R9 DONE=1 RCVD_LEN=4 within T#5s
expect rx9 hex 01 02 03 04
expect R9 trace 0001 7001 7002+ 80A1!* 7002* 7004* 7006+ 7008
"""


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return bench_project(tmp_path)


@KERNELS
def test_a_trcv_c_added_to_a_running_bench_receives_from_a_peer_added_to_it(
    tmp_path: Path, kernel: str
) -> None:
    file = tmp_path / "added.toml"
    file.write_text(EMPTY.format(steps=FROM_NOTHING.rsplit("expect R9 trace", 1)[0]))
    played = play(file, kernel)
    assert played.verdict.passed, failures(played.verdict)


def test_what_it_shows_scan_by_scan_is_what_one_of_the_file_shows(tmp_path: Path) -> None:
    file = tmp_path / "added.toml"
    file.write_text(EMPTY.format(steps=FROM_NOTHING))
    played = play(file, "sim")
    assert played.verdict.passed, failures(played.verdict)


@KERNELS
def test_an_active_connect_finds_a_passive_peer_that_was_added_before_it(tmp_path: Path, kernel: str) -> None:
    steps = """
    add peer P9 active=false replies="starts hex 01 send hex 06"
    add connect C9 ActiveEstablished=true LocalAddress=127.0.0.1 RemoteAddress=127.0.0.1 RemotePort=@P9
    add data out INT
    add instance S9 block=TSEND_C connect=C9 data=out CONT=1
    add data in BYTE
    add instance R9 block=TRCV_C connect=C9 data=in CONT=1 EN_R=1
    wait peer P9 connected within T#5s
    wait R9 STATUS=7006 within T#5s
    write out 1
    pulse S9 REQ
    expect R9 DONE=1 within T#5s
    expect in hex 06
    """
    file = tmp_path / "added.toml"
    file.write_text(EMPTY.format(steps=steps.replace('"', "'")))
    played = play(file, kernel)
    assert played.verdict.passed, failures(played.verdict)


@KERNELS
def test_udp_grows_as_well(tmp_path: Path, kernel: str) -> None:
    steps = """
    run 1
    add udp_config U1 LocalAddress=127.0.0.1
    add addr A1 RemoteAddress=127.0.0.1 RemotePort=0
    add data rx9 ARRAY[0..3] OF BYTE
    add instance R9 block=URECV_C config=U1 addr=A1 data=rx9 CONT=1 EN_R=1
    add peer P9 udp=true remote=@U1
    wait R9 STATUS=7006 within T#2s
    peer P9 send hex 0A 0B
    expect R9 DONE=1 RCVD_LEN=2 within T#2s
    """
    file = tmp_path / "added.toml"
    file.write_text(EMPTY.format(steps=steps))
    played = play(file, kernel)
    assert played.verdict.passed, failures(played.verdict)


def test_a_thirty_third_connection_is_judged_by_its_block(tmp_path: Path) -> None:
    added = [
        f"add connect C{n} LocalAddress=127.0.0.1\n"
        f"add instance R{n} block=TRCV_C connect=C{n} CONT=1\nadd peer P{n} remote=@C{n}"
        for n in range(33)
    ]
    connects = [f"peer P{n} connect" for n in range(32)]
    steps = "\n".join(
        [*added[:32], "run 5", *connects, "run 5", added[32], "expect R32 STATUS=8080 within T#1s"]
    )
    file = tmp_path / "full.toml"
    file.write_text(EMPTY.format(steps=steps))
    played = play(file, "sim")
    assert played.verdict.passed, failures(played.verdict)


def test_a_peer_that_talks_by_itself_does_so_from_the_scan_it_was_added_in(tmp_path: Path) -> None:
    steps = """
    set TRCV_C_1 CONT=1 EN_R=1
    run 5
    add peer P9 remote=@C1 reconnect=T#10ms says="random 24 seed=1" every=T#50ms
    expect TRCV_C_1 DONE=1 within T#1s
    """
    text = (CONFIGS / "passive.toml").read_text()
    (tmp_path / "p.toml").write_text(text)
    file = tmp_path / "talks.toml"
    file.write_text(f"project = 'p.toml'\n[scenario]\nsteps = '''{steps}'''\n")
    played = play(file, "sim")
    assert played.verdict.passed, failures(played.verdict)


@pytest.mark.parametrize(
    "line",
    [
        "add connect C3 ActiveEstablished=true RemoteAddress=10.0.0.7 RemotePort=@P2 KeepAliveTimeInterval=3",
        "add udp_config U1 LocalAddress=10.0.0.1 LocalPort=2000",
        "add addr A1 RemoteAddress=10.0.0.7 RemotePort=@P2",
        "add data rx2 ARRAY[0..99] OF BYTE",
        "add data rx2 Telegram",
        "add instance Z block=TRCV_C connect=C1 data=raw LEN=70000 CONT=true",
        "add instance Z block=TCON connect=C1",
        "add peer P3 remote=@C1 local=127.0.0.1:4000 reconnect=T#20ms says='hex 01' says='text \"a b\"'",
        "add peer P3 active=false local=127.0.0.1:4000 replies='contains hex 05 send hex 06 {n:2:big}'",
        "add peer P3 udp=true remote=127.0.0.1:4000 every=T#20ms",
        "add message bye peer=P1 text \"good bye\" split=2,3 gap=T#20ms",
        "add sequence twice hello T#100ms hello",
    ],
)  # fmt: skip
def test_every_form_goes_into_a_line_and_back(project: Project, line: str) -> None:
    command = parse_line(line, project, "w")
    assert command is not None
    assert parse_line(to_line(command), project, "w") == command
    assert after(command, project) is not project


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("add", "w: found nothing more, expected what to add: connect, udp_config, addr, data, instance,"),
        ("add conect C3", "w: found 'conect', expected connect"),
        ("add connect", "w: found nothing more, expected a name for the new connect"),
        ("add connect 3C", "w: connect 3C: name: found '3C', expected a name of letters, digits and _"),
        ("add connect C1", "w: connect C1: name: found 'C1', the name of another connect, expected a name"),
        ("add connect P1", "w: connect P1: name: found 'P1', the name of another peer, expected a name o"),
        ("add data X INT", "w: data X: name: found 'X', the name of another instance, expected a name of"),
        ("add data peer INT", "w: data peer: name: found 'peer', a word of the bench commands, expected "),
        ("add connect C3 LocalPort=70000", "w: connect C3: LocalPort: found '70000', expected a whole nu"),
        ("add connect C3 LocalPort", "w: found 'LocalPort', expected KEY=VALUE, once each, such as Local"),
        ("add connect C3 LocalPort=1 LocalPort=2", "w: found 'LocalPort=2', expected KEY=VALUE, once each"),
        ("add connect C3 LocalAddress=300.1.1.1", "w: connect C3: LocalAddress: found '300.1.1.1', expec"),
        ("add connect C3 RemotePort=@P9", "w: connect C3: RemotePort: found 'P9', expected one of P1, P2"),
        ("add connect C3 Port=1", "w: connect C3: Port: found an unknown key, expected one of name, Active"),
        ("add data rx2 INTT", "w: data rx2: type:1:1: found 'INTT', expected"),
        ("add data rx2", "w: found nothing more, expected an IEC type or a UDT"),
        ("add instance Z connect=C1", "w: instance Z: block: found nothing, expected a text in quotes"),
        ("add instance Z block=TRCV connect=C2", "w: instance Z: connect: found 'C2', expected C1"),
        ("add instance Z block=TRCV_C connect=C1 DONE=1", "w: instance Z: DONE: found an output, expecte"),
        ("add instance Z block=TRCV_C connect=C1 EN_R=2", "w: instance Z: EN_R: found '2', expected true"),
        ("add instance Z block=TCON connect=C1 data=raw", "w: instance Z: data: found 'raw', expected no"),
        ("add instance Z block=TRCV_C connect=C1 task=FAST", "w: instance Z: task: found 'FAST', expecte"),
        ("add peer P3 remote=@C9", "w: peer P3: remote: found 'C9', expected C1"),
        ("add peer P3 remote=@C1 says='hex 0z'", "w: peer P3: says #1: hex, position 2: found 'z', expec"),
        ("add peer P3 remote=@C1 replies='contains'", "w: peer P3: replies #1: found nothing more, expected"),
        ("add message hello hex 01", "w: message hello: name: found 'hello', the name of another message"),
        ("add message m hex 0z", "w: message m: hex, position 2: found 'z', expected hex bytes such as 0"),
        ("add message m peer=P9 hex 01", "w: message m: peer: found 'P9', expected one of P1, P2"),
        ('add message m text "hi" split=99', "w: message m: found split=99 of 2 bytes, expected cut"),
        ("add peer P3", "w: peer P3: found neither remote nor local, expected remote=@C1 (it connec"),
        ("add message m", "w: found nothing more, expected what stands after `peer P1 send`, such as he"),
        ("add sequence s hullo", "w: sequence s: steps #1: found 'hullo', expected hello, or a pause suc"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_clear_line(project: Project, line: str, expected: str) -> None:
    with pytest.raises(UserError) as wrong:
        parse_line(line, project, "w")
    assert wrong.value.lines()[0].startswith(expected)
