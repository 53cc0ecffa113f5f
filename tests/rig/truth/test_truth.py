"""What-if says what a run with the other parameters really does, or that it does not know.

`-s` shows the cases: kind, question, verdict, DONE of the recorded run, the what-if and the real run. Their
scenarios and recordings stay in the folder of the test.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.rig.scenarios import CONFIGS
from tests.rig.truth.cases import CALLS, LISTENS, PEER, TCP, cases, pins, receiver, scenario
from tests.rig.truth.runs import CANNOT, Case, ask, judge, run, sizes


def test_of_sixty_random_questions_none_is_answered_wrong_without_a_word(tmp_path: Path) -> None:
    rows, words = [""], []
    for number, case in enumerate(cases()):
        verdict = judge(case, tmp_path / f"{number}")
        words.append(verdict.word)
        rows.append(f"{number:2} {case.kind:9} {case.question:39} {verdict}")
        print(rows[-1])
    silent = "\n".join(row for row in rows if "SILENT" in row)
    assert (len(words), silent) == (60, "")
    assert words.count("equal") >= 45
    assert sum("nothing changes" in row for row in rows) <= 10


def messages(
    size: int,
    data: int,
    *steps: str,
    every: int = 100,
    peer: str = PEER,
    connect: str = TCP,
    **inputs: object,
) -> str:
    """Return a scenario: a partner sends 25 messages."""
    parts = receiver("TRCV_C", data, pins(CONT=True, **{"EN_R": True, **inputs}))
    send = f"peer P1 send random {size} seed=1 repeat=25 every=T#{every}ms"
    return scenario("baosky", connect, parts, peer, ["run T#200ms", send, *(steps or ["run T#3s"])])


@pytest.mark.parametrize(("size", "data"), [(20, 22), (33, 50)])
def test_messages_shorter_than_data_come_whole_when_the_question_is_ad_hoc(
    size: int, data: int, tmp_path: Path
) -> None:
    verdict = judge(Case("", messages(size, data), ("instance.R.ADHOC=true",)), tmp_path / "1")
    assert verdict.word == "equal", str(verdict)
    assert sizes(verdict.told.moments["what-if"], "R") == [size] * 25


def test_the_story_of_len_has_three_done_with_the_bytes_that_a_reset_threw_away(tmp_path: Path) -> None:
    recording = tmp_path / "night.pcapng"
    run(CONFIGS / "scenarios" / "stories" / "four-bytes-short.toml", record=recording)
    told = ask(recording, Case("", "", ("instance.TRCV_C_1.LEN=20",)))
    done = [
        (at // 10_000_000 + 1, one[5]) for at, shown in told.moments["what-if"] for one in shown if one[3]
    ]
    assert (done, told.guess_from) == ([(53, 20), (3051, 20), (6051, 20)], None)


def test_a_partner_that_speaks_each_30_ms_to_a_plc_of_100_ms(tmp_path: Path) -> None:
    late = messages(10, 10, "run T#4900ms", every=30, peer=PEER.replace("100", "9000"))
    text = late.replace("repeat=25", "repeat=160").replace(
        "run T#200ms", "run T#500ms\npeer P1 connect\nrun T#200ms"
    )
    verdict = judge(Case("", text, ("task.MAIN.interval=T#100ms",)), tmp_path / "1")
    assert verdict.word == "equal", str(verdict)


def test_en_r_of_a_run_without_it_completes_jobs(tmp_path: Path) -> None:
    text = messages(8, 8, EN_R=False)
    verdict = judge(Case("", text, ("instance.R.EN_R=true",)), tmp_path / "1")
    assert verdict.word == "equal", str(verdict)
    assert sizes(verdict.told.moments["what-if"], "R") == [8] * 25


def test_another_pause_between_calls_is_no_other_run_without_a_word(tmp_path: Path) -> None:
    nobody = messages(8, 8, "run T#10s", connect=CALLS.replace("@P1", "127"), peer=LISTENS)
    text = nobody.replace('RemotePort = "127"', "RemotePort = 3000").replace("peer P1 send", "# peer P1 send")
    verdict = judge(Case("", text, ("options.retry=T#200ms",)), tmp_path / "1")
    assert verdict.word != "SILENT", str(verdict)


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
    active = CALLS + "KeepAliveTimeInterval = 2\n"
    path.write_text(messages(8, 8, "link C1 down", "run T#8s", peer=LISTENS, connect=active))
    run(path, record=recording)
    told = ask(recording, Case("", "", (question,)))
    assert (told.code, told.moments["what-if"], CANNOT in told.stderr) == (2, [], True), told.stderr
