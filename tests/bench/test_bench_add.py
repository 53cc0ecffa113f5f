"""`add`: one more instance, CONNECT, DATA, peer, message of a running bench, as good as one of the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenario.scenarios import CONFIGS, failures, play

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


def holds(folder: Path, steps: str, kernel: str) -> None:
    file = folder / "added.toml"
    file.write_text(EMPTY.format(steps=steps))
    played = play(file, kernel)
    assert played.verdict.has_passed, failures(played.verdict)


def test_what_it_shows_scan_by_scan_is_what_one_of_the_file_shows(tmp_path: Path) -> None:
    holds(tmp_path, FROM_NOTHING, "sim")


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
    holds(tmp_path, steps.replace('"', "'"), kernel)


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
    holds(tmp_path, steps, kernel)


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
    holds(tmp_path, steps, "sim")


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
    assert played.verdict.has_passed, failures(played.verdict)
