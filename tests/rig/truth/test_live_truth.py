"""What-if of runs with partners from outside: unchanged it is the run, changed what a real run does."""

from __future__ import annotations

import os
import re
import socket
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from tests.certificates import NEEDS_OPENSSL
from tests.e2e.terminal import need
from tests.rig.test_recorded_run import SCENARIOS
from tests.rig.test_tls_blocks import CLIENT, CONNECT, HEAD, RECEIVES, SERVER, openssl, s_client, s_server
from tests.rig.truth.cases import CALLS, ISO, SOURCE, TCP, array, pins, receiver
from tests.rig.truth.live_plc import LivePlc, fill, live_plc, read, resets, shown
from tests.rig.truth.runs import Case, ask, records, run
from trcvtui.rig.scenario.scenario import load_scenario

Conduct = Callable[[LivePlc, socket.socket], object]


def nothing_differs(recording: Path, dialect: str, ran: list[str]) -> None:
    """Ask for the dialect that it has: both runs are the one that was."""
    told = ask(recording, Case("", "", dialect=dialect))
    assert (told.code, told.guess_from, told.sums["parts_at_scan"]) == (0, None, None), told.stderr
    assert told.sums["what_if"] == told.sums["recorded"]
    assert shown(records(told.text, "recorded")) == shown(read(ran))
    assert shown(records(told.text, "what-if")) == shown(read(ran))


@pytest.mark.parametrize("path", SCENARIOS[3 :: len(SCENARIOS) // 20][:20], ids=lambda path: path.stem)
def test_an_unchanged_what_if_of_a_scenario_is_its_run(path: Path, tmp_path: Path) -> None:
    recording = tmp_path / "R.pcapng"
    ran = [line for line in run(path, record=recording).splitlines() if line.startswith('{"scan":')]
    nothing_differs(recording, load_scenario(path).project.dialect.name, ran)


# -- partners in Python ------------------------------------------------------------------------------------


def plc_text(
    connect: str = TCP, data: int = 20, dialect: str = "baosky", more: str = "", **inputs: object
) -> str:
    own = receiver("TRCV_C", data, pins(**{"EN_R": True, "CONT": True, **inputs}))
    return f'dialect = "{dialect}"\n{more}[[connect]]\nname = "C1"\n{connect}{own}'


def sender(size: int) -> str:
    """Return a TSEND_C that sends in each second scan."""
    tx = f'[[data]]\nname = "tx"\ntype = "{array(size)}"\n[[instance]]\nname = "S"\nblock = "TSEND_C"\n'
    return f'start = "set S REQ=blink"\n{tx}connect = "C1"\ndata = "tx"\nCONT = true\n'


def speaks(plc: LivePlc, sock: socket.socket) -> None:
    for size in (20, 20, 7, 13, 33, 40):
        sock.sendall(bytes(range(size)))
        plc.passes(4)


def speaks_at_once(plc: LivePlc, sock: socket.socket) -> None:
    for size in range(1, 60):
        sock.sendall(bytes(size))


def resets_in_a_message(plc: LivePlc, sock: socket.socket) -> None:
    sock.sendall(bytes(30))
    plc.passes(3)
    resets(sock)


def resets_at_once(plc: LivePlc, sock: socket.socket) -> None:
    sock.sendall(bytes(50))
    resets(sock)


def half_closes(plc: LivePlc, sock: socket.socket) -> None:
    sock.sendall(bytes(50))
    ends_its_half(sock)


def ends_its_half(sock: socket.socket) -> None:
    sock.shutdown(socket.SHUT_WR)
    with suppress(ConnectionError):
        while sock.recv(65536):
            pass


def stalls(plc: LivePlc, sock: socket.socket) -> None:
    for _ in range(3):
        sock.sendall(bytes(13))
        plc.passes(40)


def floods(plc: LivePlc, sock: socket.socket) -> None:
    fill(sock, plc)
    ends_its_half(sock)


def floods_and_resets(plc: LivePlc, sock: socket.socket) -> None:
    fill(sock, plc)
    resets(sock)


def reads_late(plc: LivePlc, sock: socket.socket) -> None:
    plc.passes(60)
    for _ in range(40):
        sock.recv(65536)
    sock.sendall(bytes(20))
    plc.passes(3)


def never_reads(plc: LivePlc, sock: socket.socket) -> None:
    plc.passes(60)


def echoes(plc: LivePlc, sock: socket.socket) -> None:
    for _ in range(20):
        sock.sendall(sock.recv(65536))


def tpkt(message: bytes) -> bytes:
    return bytes([3, 0, *(len(message) + 4).to_bytes(2, "big")]) + message


def speaks_iso(plc: LivePlc, sock: socket.socket) -> None:
    sock.sendall(tpkt(bytes.fromhex("11 E0 0000 0001 00 C1 02 E001 C2 02 E002 C0 01 0A")))
    assert sock.recv(100)[5] == 0xD0
    for size in (20, 7, 33, 20, 12):
        message = tpkt(b"\x02\xf0\x80" + bytes(size))
        sock.sendall(message[:6])
        plc.passes(2)
        sock.sendall(message[6:] + message)
        plc.passes(size % 5)


def resets_iso(plc: LivePlc, sock: socket.socket) -> None:
    speaks_iso(plc, sock)
    sock.sendall(tpkt(b"\x02\xf0\x80" + bytes(15))[:9])
    resets(sock)


OUTSIDE: dict[str, tuple[str, Conduct]] = {
    "messages": (plc_text(), speaks),
    "messages, DATA too large": (plc_text(data=22), speaks),
    "messages, ad hoc": (plc_text(ADHOC=True), speaks_at_once),
    "messages, s7-1500": (plc_text(data=12, dialect="s7-1500"), speaks_at_once),
    "reset in a message": (plc_text(), resets_in_a_message),
    "reset at once": (plc_text(), resets_at_once),
    "half-close": (plc_text(), half_closes),
    "stall": (plc_text(), stalls),
    "flood": (plc_text(data=60000), floods),
    "flood and reset": (plc_text(data=60000), floods_and_resets),
    "flood of an idle PLC": (plc_text(EN_R=False), floods_and_resets),
    "late reader": (plc_text(more=sender(60000)), reads_late),
    "no reader": (plc_text(more=sender(60000)), never_reads),
    "echo": (plc_text(more=sender(20)), echoes),
    "ISO": (plc_text(ISO, dialect="s7-1500"), speaks_iso),
    "ISO, reset": (plc_text(ISO, dialect="s7-1500"), resets_iso),
}


@pytest.mark.live
@pytest.mark.slow
@pytest.mark.parametrize("name", OUTSIDE)
def test_an_unchanged_what_if_of_a_run_with_a_partner_from_outside_is_the_run(
    name: str, tmp_path: Path
) -> None:
    text, conduct = OUTSIDE[name]
    with live_plc(text, tmp_path) as plc:
        port = plc.port

        def partner() -> None:
            for _ in range(2):  # it comes again
                with plc.called(port) as sock:
                    conduct(plc, sock)
                plc.passes(10)

        plc.beside(partner)
    nothing_differs(plc.recording, text.split('"')[1], plc.lines)


@pytest.mark.live
@pytest.mark.slow
def test_an_unchanged_what_if_of_a_plc_that_calls_is_the_run(tmp_path: Path) -> None:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        text = plc_text(CALLS.replace('"@P1"', str(listener.getsockname()[1])))
        with live_plc(text, tmp_path) as plc:

            def partner() -> None:
                plc.passes(20)  # so long it is refused
                listener.listen()
                for conduct in (resets_at_once, speaks, half_closes, lambda plc, sock: resets(sock), stalls):
                    sock, _ = listener.accept()
                    with sock:
                        conduct(plc, sock)

            plc.beside(partner)
        nothing_differs(plc.recording, "baosky", plc.lines)


# -- partners that nobody here wrote -----------------------------------------------------------------------


UDP = 'config = "U1"\naddr = "SOURCE"\n'


def udp_text(data: int, dialect: str = "baosky", **inputs: object) -> str:
    block, held = ("URECV_C", {"CONT": True}) if dialect == "baosky" else ("TURCV", {})
    return f'dialect = "{dialect}"\n{SOURCE}' + receiver(
        block, data, pins(**{"EN_R": True, **held, **inputs}), UDP
    )


@pytest.mark.live
@pytest.mark.slow
@pytest.mark.parametrize("dialect", ["baosky", "s7-1500"])
def test_an_unchanged_what_if_of_datagrams_is_the_run(dialect: str, tmp_path: Path) -> None:
    with live_plc(udp_text(20, dialect), tmp_path) as plc, socket.socket(type=socket.SOCK_DGRAM) as sock:
        sock.connect(("127.0.0.1", plc.port))
        for size in (20, 1, 33, 0, 7, *[20] * 900):  # more than its queue takes
            sock.send(bytes(size))
            plc.run(size == 33)
        plc.run(60)
    nothing_differs(plc.recording, dialect, plc.lines)


@NEEDS_OPENSSL
@pytest.mark.live
@pytest.mark.slow
@pytest.mark.parametrize("is_server", [False, True])
def test_an_unchanged_what_if_of_a_run_with_openssl_is_the_run(is_server: bool, secure_bench: Path) -> None:
    with ExitStack() as opened:
        if is_server:
            words = "-cert partner.pem -key partner.key -quiet"
            port, program = opened.enter_context(s_server(secure_bench, words.replace(" -quiet", "")))
            text = HEAD + RECEIVES + CONNECT + CLIENT.format(port=port)
            plc = opened.enter_context(live_plc(text, secure_bench))
        else:
            plc = opened.enter_context(live_plc(HEAD + RECEIVES + CONNECT + SERVER, secure_bench))
            words = "-cert partner.pem -key partner.key -verify_return_error"
            program = opened.enter_context(openssl(secure_bench, s_client(plc.port, words)))
        assert program.stdin is not None
        for message in (b"abcd", b"efghijk", b"l" * 33):
            program.stdin.write(message)
            program.stdin.flush()
            plc.until_done()
        program.stdin.close()
        plc.run(30)
        program.kill()
        plc.run(30)
        plc.close()
        nothing_differs(plc.recording, "s7-1500", plc.lines)


@contextmanager
def socat(end: str) -> Iterator[int]:
    """Return where to write what socat sends to this end."""
    with subprocess.Popen([need("socat"), "-u", "-", end], stdin=subprocess.PIPE) as program:
        assert program.stdin is not None
        yield program.stdin.fileno()


def spoken_by_socat(text: str, messages: list[int], folder: Path) -> LivePlc:
    """Let socat send messages to a new PLC, each more than four scans after the one before has come."""
    folder.mkdir()
    is_udp = "[[udp_config]]" in text
    with live_plc(text, folder) as plc:
        end = f"UDP4:127.0.0.1:{plc.port}" if is_udp else f"TCP4:127.0.0.1:{plc.port}"
        with socat(end) as to:
            for number, size in enumerate(messages):
                os.write(to, bytes([number]) * size)
                if not is_udp:
                    plc.until_arrived(sum(messages[: number + 1]))
                plc.run(6)
        plc.run(30)
    return plc


def jobs(lines: list[dict[str, Any]]) -> tuple[list[Any], list[Any]]:
    """Return what DONE had, and STATUS in order from the first DONE on; in which scan is up to the clock."""
    done = [number for number, line in enumerate(lines) if line["DONE"]]
    return [lines[at]["RCVD_LEN"] for at in done], [line["STATUS"] for line in lines[min(done, default=0) :]]


QUESTIONS: list[tuple[str, list[int], str, str]] = [
    (plc_text(data=22), [20] * 25, "instance.R.ADHOC=true", "ADHOC = true"),
    (plc_text(data=50), [33] * 25, "instance.R.ADHOC=true", "ADHOC = true"),
    (plc_text(data=22), [20] * 25, "instance.R.LEN=20", "LEN = 20"),
    (plc_text(data=20), [20] * 12, "instance.R.LEN=7", "LEN = 7"),
    (plc_text(data=24, LEN=8), [20, 4] * 9, "instance.R.LEN=24", "LEN = 24"),
    (plc_text(data=30), [20, 11] * 8, f"data.rx.type={array(31)}", array(31)),
    (plc_text(data=30, ADHOC=True), [20, 10, 33] * 5, "instance.R.ADHOC=false", "ADHOC = false"),
    (plc_text(data=20, EN_R=False), [20] * 9, "instance.R.EN_R=true", "EN_R = true"),
    (plc_text(data=22, dialect="s7-1500"), [20] * 15, "instance.R.ADHOC=true", "ADHOC = true"),
    (udp_text(16), [20, 12] * 8, f"data.rx.type={array(24)}", array(24)),
]


@pytest.mark.live
@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(QUESTIONS)))
def test_a_question_of_what_socat_has_sent_is_answered_as_a_real_run_goes(
    number: int, tmp_path: Path
) -> None:
    text, messages, question, asked = QUESTIONS[number]
    was = spoken_by_socat(text, messages, tmp_path / "A")
    key = asked.split(" = ")[0]
    other = (
        re.sub(rf"(?m)^{key} = .*$", asked, text) if key != asked else re.sub(r"ARRAY.* BYTE", asked, text)
    )
    other = other if asked in other else f"{text}{asked}\n"
    assert other != text
    true = jobs(read(spoken_by_socat(other, messages, tmp_path / "B").lines))
    nothing_differs(was.recording, text.split('"')[1], was.lines)
    told = ask(was.recording, Case("", "", (question,)))
    print(question, sorted(true[0]), told.guess_from)
    assert (told.code, told.guess_from) == (0, None), told.stderr
    assert jobs(records(told.text, "what-if")) == true
