"""What-if of runs with partners from outside: unchanged it is the run, changed what a real run does."""

from __future__ import annotations

import os
import re
import socket
import subprocess
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.bench.test_tls_blocks import CLIENT, CONNECT, HEAD, RECEIVES, SERVER, openssl, s_client, s_server
from tests.certificates import NEEDS_OPENSSL
from tests.diagnosis.truth.cases import CALLS, ISO, TCP, array, pins, receiver, sender, udp_receiver
from tests.diagnosis.truth.live_plc import LivePlc
from tests.diagnosis.truth.runs import Case, ask, shown
from tests.e2e.terminal import need


def nothing_differs(recording: Path, dialect: str, ran: list[dict[str, Any]]) -> None:
    """Ask for the dialect that it has: both runs are the one that was."""
    told = ask(recording, Case("", "", dialect=dialect))
    assert (told.code, told.guess_from, told.sums["parts_at_scan"]) == (0, None, None), told.stderr
    assert told.sums["what_if"] == told.sums["recorded"]
    was, now, true = ([(one["scan"], shown(one)) for one in side] for side in (*told.both, ran))
    assert (was, now) == (true, true)


def plc_text(
    connect: str = TCP, data: int = 20, dialect: str = "baosky", more: str = "", **inputs: object
) -> str:
    own = receiver("TRCV_C", data, pins(**{"EN_R": True, "CONT": True, **inputs}))
    return f'dialect = "{dialect}"\n{more}[[connect]]\nname = "C1"\n{connect}{own}'


def udp_text(data: int, dialect: str = "baosky") -> str:
    return f'dialect = "{dialect}"\n' + udp_receiver(data, dialect, EN_R=True)


SPEAKS = "send 20, wait 4, send 20, wait 4, send 7, wait 4, send 13, wait 4, send 33, wait 4, send 40, wait 4"
AT_ONCE = ", ".join(f"send {size}" for size in range(1, 60))
STALLS = "send 13, wait 40, send 13, wait 40, send 13, wait 40"
BLINKS = 'start = "set S REQ=blink"\n'
ISO_CALLS = (
    "hex 03000016 11E0 0000 0001 00 C102E001 C202E002 C0010A, read 1, iso 20, wait 3, iso 7, iso 33, iso 5"
)
HALF_A_DT = "hex 0300001602F080 00, wait 3, hex 01 02 03 04 05 06 07 08 09 0A 0B 0C 0D 0E, wait 2, hex 0300"
OUTSIDE = {
    "messages": (plc_text(), SPEAKS),
    "messages, DATA too large": (plc_text(data=22), SPEAKS),
    "messages, ad hoc": (plc_text(ADHOC=True), AT_ONCE),
    "messages, s7-1500": (plc_text(data=12, dialect="s7-1500"), AT_ONCE),
    "reset in a message": (plc_text(), "send 30, wait 3, rst"),
    "reset at once": (plc_text(), "send 50, rst"),
    "half-close": (plc_text(), "send 50, half-close"),
    "stall": (plc_text(), STALLS),
    "flood": (plc_text(data=60000), "flood, half-close"),
    "flood and reset": (plc_text(data=60000), "flood, rst"),
    "flood of an idle PLC": (plc_text(EN_R=False), "flood, rst"),
    "late reader": (plc_text(more=BLINKS + sender(60000)), "wait 60, read 40, send 20, wait 3"),
    "no reader": (plc_text(more=BLINKS + sender(60000)), "wait 60"),
    "duplex": (plc_text(more=BLINKS + sender(20)), ", ".join(["read 1, send 20"] * 20)),
    "ISO": (plc_text(ISO, dialect="s7-1500"), f"{ISO_CALLS}, wait 4, {HALF_A_DT}"),
    "ISO, reset": (plc_text(ISO, dialect="s7-1500"), f"{ISO_CALLS}, hex 030000, rst"),
}


@pytest.mark.live
@pytest.mark.slow
@pytest.mark.parametrize("name", OUTSIDE)
def test_an_unchanged_what_if_of_a_partner_from_outside_is_the_run(name: str, tmp_path: Path) -> None:
    text, script = OUTSIDE[name]
    with LivePlc(text, tmp_path) as plc:
        port = plc.port()

        def partner() -> None:
            for _ in range(2):  # it comes again
                plc.conduct(script, plc.called(port))
                plc.passes(10)

        plc.beside(partner)
    nothing_differs(plc.recording, plc.dialect, plc.lines)


@pytest.mark.live
@pytest.mark.slow
def test_an_unchanged_what_if_of_a_plc_that_calls_is_the_run(tmp_path: Path) -> None:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        with LivePlc(plc_text(CALLS.replace('"@P1"', str(listener.getsockname()[1]))), tmp_path) as plc:

            def partner() -> None:
                plc.passes(20)  # so long it is refused
                listener.listen()
                for script in ("send 50, rst", SPEAKS, "send 50, half-close", "rst", STALLS):
                    plc.conduct(script, listener.accept()[0])

            plc.beside(partner)
    nothing_differs(plc.recording, plc.dialect, plc.lines)


@pytest.mark.live
@pytest.mark.slow
@pytest.mark.parametrize("dialect", ["baosky", "s7-1500"])
def test_an_unchanged_what_if_of_datagrams_is_the_run(dialect: str, tmp_path: Path) -> None:
    with LivePlc(udp_text(20, dialect), tmp_path) as plc, socket.socket(type=socket.SOCK_DGRAM) as sock:
        sock.connect(("127.0.0.1", plc.port()))
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
    text, shows = HEAD + RECEIVES + CONNECT, "-cert partner.pem -key partner.key"
    with ExitStack() as opened:
        if is_server:
            port, program = opened.enter_context(s_server(secure_bench, shows))
            plc = opened.enter_context(LivePlc(text + CLIENT.format(port=port), secure_bench))
        else:
            plc = opened.enter_context(LivePlc(text + SERVER, secure_bench))
            program = opened.enter_context(openssl(secure_bench, s_client(plc.port(), shows)))
        assert program.stdin is not None
        for number, message in enumerate((b"abcd", b"efghijk", b"l" * 33)):
            program.stdin.write(message)
            program.stdin.flush()
            plc.until_done(number + 1)
        program.stdin.close()
        plc.run(30)
        program.kill()
        plc.run(30)
    nothing_differs(plc.recording, plc.dialect, plc.lines)


# -- a partner that nobody here wrote, and that pauses -------------------------------------------------------


def spoken_by_socat(text: str, messages: list[int], folder: Path) -> LivePlc:
    """Let socat send messages to a new PLC, each six scans after the one before has come."""
    folder.mkdir()
    is_udp = "[[udp_config]]" in text
    with LivePlc(text, folder) as plc:
        end = f"{'UDP4' if is_udp else 'TCP4'}:127.0.0.1:{plc.port()}"
        with subprocess.Popen([need("socat"), "-u", "-", end], stdin=subprocess.PIPE) as program:
            assert program.stdin is not None
            for number, size in enumerate(messages):
                os.write(program.stdin.fileno(), bytes([number]) * size)
                if not is_udp:
                    plc.until_arrived(sum(messages[: number + 1]))
                plc.run(6)
        plc.run(30)
    return plc


def jobs(lines: list[dict[str, Any]]) -> tuple[list[Any], list[Any]]:
    """Return what DONE had, and STATUS in order from the first DONE on; in which scan is up to the clock."""
    done = [number for number, line in enumerate(lines) if line["DONE"]]
    return [lines[at]["RCVD_LEN"] for at in done], [line["STATUS"] for line in lines[min(done, default=0) :]]


QUESTIONS = [
    (plc_text(data=22), [20] * 25, "instance.R.ADHOC=true"),
    (plc_text(data=50), [33] * 25, "instance.R.ADHOC=true"),
    (plc_text(data=22), [20] * 25, "instance.R.LEN=20"),
    (plc_text(data=20), [20] * 12, "instance.R.LEN=7"),
    (plc_text(data=24, LEN=8), [20, 4] * 9, "instance.R.LEN=24"),
    (plc_text(data=30), [20, 11] * 8, f"data.rx.type={array(31)}"),
    (plc_text(data=30, ADHOC=True), [20, 10, 33] * 5, "instance.R.ADHOC=false"),
    (plc_text(data=20, EN_R=False), [20] * 9, "instance.R.EN_R=true"),
    (plc_text(data=22, dialect="s7-1500"), [20] * 15, "instance.R.ADHOC=true"),
    (udp_text(16), [20, 12] * 8, f"data.rx.type={array(24)}"),
]


@pytest.mark.live
@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(QUESTIONS)))
def test_a_question_of_what_socat_has_sent_is_answered_as_a_real_run_goes(
    number: int, tmp_path: Path
) -> None:
    text, messages, question = QUESTIONS[number]
    key, _, value = question.partition("=")
    pin = key.rpartition(".")[2]
    plain = re.sub(rf"(?m)^{pin} = .*\n", "", text)
    other = plain + f"{pin} = {value}\n" if pin != "type" else re.sub("ARRAY.*BYTE", value, text)
    was = spoken_by_socat(text, messages, tmp_path / "A")
    true = jobs(spoken_by_socat(other, messages, tmp_path / "B").lines)
    nothing_differs(was.recording, was.dialect, was.lines)
    told = ask(was.recording, Case("", "", (question,)))
    assert told.code == 0, told.stderr
    # the partner has ended then: an RST of ours for bytes that were unread is another end for it
    assert told.guess_from is None or told.guess_from > max(
        line["scan"] for line in told.both[1] if line["DONE"]
    )
    assert jobs(told.both[1]) == true
