"""What-if says what a run with the other parameters really does, or that it does not know.

`-s` shows the cases: kind, question, verdict, DONE of the recorded run, the what-if and the real run, and
the first difference. Their scenarios and recordings stay in the folder of the test.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.bench.test_tls_blocks import CONNECT, HEAD, RECEIVES, SERVER
from tests.certificates import NEEDS_OPENSSL
from tests.diagnosis.truth.cases import (
    CALLS,
    ISO,
    ISO_PEER,
    LISTENS,
    PEER,
    TCP,
    cases,
    pins,
    receiver,
    scenario,
)
from tests.diagnosis.truth.runs import CANNOT, Case, ask, judge, run, sizes
from tests.scenario.scenarios import CONFIGS


def test_of_random_questions_none_is_answered_wrong_without_a_word(tmp_path: Path) -> None:
    # A third of them with the one whose answer is wrong and says that it is a guess: 41.
    found, (first, every) = [], (0, 1) if "TRCVTUI_SOAK" in os.environ else (2, 3)
    for number, case in list(enumerate(cases()))[first::every]:
        verdict = judge(case, tmp_path / f"{number}")
        question = case.sets[0] if case.sets else case.dialect
        found.append((verdict.word, f"{number:2} {case.kind:9} {question:35} {verdict}"))
        print(found[-1][1])
    words = [word for word, _ in found]
    assert [row for word, row in found if word == "SILENT"] == []
    assert len(words) == 60 // every and words.count("equal") >= 45 // every
    assert sum("(same)" in row for _, row in found) <= 10 // every  # else the questions are not worth it


def messages(
    size: int, data: int, *steps: str, peer: str = PEER, connect: str = TCP, en_r: bool = True
) -> str:
    """Return a scenario; without steps of its own the partner sends 25 messages."""
    own = steps or ("run T#200ms", f"peer P1 send random {size} seed=1 repeat=25 every=T#100ms", "run T#3s")
    return scenario("baosky", connect, receiver("TRCV_C", data, pins(CONT=True, EN_R=en_r)), peer, [*own])


AT_30_MS = messages(
    10,
    10,
    *("run T#500ms", "peer P1 connect", "run T#100ms"),
    *("peer P1 send random 10 seed=1 repeat=160 every=T#30ms", "run T#5s"),
    peer=PEER.replace("100ms", "1h"),
)


@pytest.mark.parametrize(
    ("text", "question", "found"),
    [
        (messages(20, 22), "instance.R.ADHOC=true", [20] * 25),
        (messages(33, 50), "instance.R.ADHOC=true", [33] * 25),
        (messages(8, 8, en_r=False), "instance.R.EN_R=true", [8] * 25),
        (AT_30_MS, "task.MAIN.interval=T#100ms", [10] * 22),
    ],
)
def test_a_question_that_was_answered_wrong_is_answered_right(
    text: str, question: str, found: list[int], tmp_path: Path
) -> None:
    verdict = judge(Case("", text, (question,)), tmp_path / "1")
    assert verdict.word == "equal", str(verdict)
    assert sizes(verdict.told.both[1])[: len(found)] == found


def test_the_story_of_len_has_three_done_with_the_bytes_that_a_reset_threw_away(tmp_path: Path) -> None:
    recording = tmp_path / "night.pcapng"
    run(CONFIGS / "scenarios" / "stories" / "four-bytes-short.toml", record=recording)
    told = ask(recording, Case("", "", ("instance.TRCV_C_1.LEN=20",)))
    done = [(line["scan"], line["RCVD_LEN"]) for line in told.both[1] if line["DONE"]]
    assert (done, told.guess_from) == ([(53, 20), (3051, 20), (6051, 20)], None)


@pytest.mark.slow
@pytest.mark.skipif("TRCVTUI_SOAK" not in os.environ, reason="takes half a minute: make soak")
def test_an_unchanged_what_if_of_more_than_128_mib_is_the_run(tmp_path: Path) -> None:
    send = "peer P1 send random 65535 seed=1 repeat=2100 every=T#20ms"
    case = Case("", messages(0, 65535, "run T#200ms", send, "run T#43s"), dialect="baosky")
    verdict = judge(case, tmp_path / "1")
    (tmp_path / "1" / "case.pcapng").unlink()
    assert (verdict.word, len(sizes(verdict.told.both[1]))) == ("equal", 2100), str(verdict)


ISO_IDLE = scenario(
    "s7-1500",
    ISO,
    receiver("TRCV_C", 10, pins(CONT=True, EN_R=False)),
    ISO_PEER + 'says = ["hex 01 02 03"]\nevery = "T#50ms"\n',
    ["run T#1s"],
)


@pytest.mark.parametrize(
    ("text", "question"),
    [
        (
            messages(8, 8, "run T#10s", connect=CALLS.replace('"@P1"', "3000"), peer=LISTENS),
            "options.retry=T#200ms",
        ),
        (ISO_IDLE, "instance.R.EN_R=true"),  # its session holds four messages, the others are in the stack
        (messages(8, 8, "run T#100ms", "peer P1 connect", "run T#500ms"), "task.MAIN.interval=T#50ms"),
        (
            messages(
                8, 8, "run T#500ms", "fault recv ECONNRESET", "peer P1 send hex 01", "run T#500ms", en_r=False
            ),
            "instance.R.EN_R=true",
        ),
    ],
    ids=[
        "calls at other times",
        "messages below a session",
        "a client in the scan of listen",
        "a planned fault",
    ],
)
def test_what_nobody_knows_is_a_guess(text: str, question: str, tmp_path: Path) -> None:
    verdict = judge(Case("", text, (question,)), tmp_path / "1")
    assert verdict.word in ("equal", "marked"), str(verdict)


@NEEDS_OPENSSL
def test_what_lies_below_a_tls_session_is_a_guess(secure_bench: Path) -> None:
    text = (
        HEAD.replace("0..3", "0..29999") + RECEIVES.replace("EN_R = true", "EN_R = false") + CONNECT + SERVER
    )
    text += (
        '[[certificate]]\nnumber = 3\nfile = "certificates/partner.pem"\nkey = "certificates/partner.key"\n'
    )
    text += (
        f'[[peer]]\nname = "P1"\ntls = true\ncertificate = 3\nauthority = 1\n{PEER}[scenario]\nsteps = """\n'
    )
    text += 'run T#500ms\npeer P1 send random 30000 seed=1 repeat=9 every=T#50ms\nrun T#1s\n"""\n'
    text = text.replace('"certificates/', f'"{secure_bench}/certificates/')
    verdict = judge(Case("", text, ("instance.X.EN_R=true",)), secure_bench / "below")
    assert verdict.word in ("equal", "marked"), str(verdict)


@pytest.mark.parametrize(
    "question",
    [
        *(f"connect.C1.KeepAliveTimeInterval={seconds}" for seconds in (1, 3, 5, 20, 0)),
        "connect.C1.RemotePort=3001",
        "connect.C1.LocalPort=2001",
        "peer.P1.every=T#10ms",
        "sim.latency=T#5ms",
    ],
)
def test_what_decides_what_a_partner_meets_is_refused(question: str, tmp_path: Path) -> None:
    path, recording = tmp_path / "case.toml", tmp_path / "case.pcapng"
    keeps_alive = CALLS + "KeepAliveTimeInterval = 2\n"
    steps = ("run T#200ms", "peer P1 send hex 01", "link C1 down", "run T#8s")
    path.write_text(messages(8, 8, *steps, peer=LISTENS, connect=keeps_alive))
    run(path, record=recording)
    told = ask(recording, Case("", "", (question,)))
    assert (told.code, told.both[1], CANNOT in told.stderr) == (2, [], True), told.stderr
