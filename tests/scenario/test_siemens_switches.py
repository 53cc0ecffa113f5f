"""The switches of the Siemens dialects: what each changes, scan by scan, simulated."""

from __future__ import annotations

from itertools import groupby

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.commands.table import parse_script
from trcvtui.commands.words import RunScans
from trcvtui.dialects.dialect import defaults, format_value
from trcvtui.dialects.siemens.rules import S7_1200, S7_1200_LEGACY, S7_1500, SWITCHES
from trcvtui.project.file import load_project

SENDER, RECEIVER, PAIR = "s7-sender.toml", "s7-receiver.toml", "s7-pair.toml"


def shown(project: str, instance: str, script: str, *overrides: str) -> str:
    """Return what an instance showed, such as `7001 7002{2} 80C5!`; `b` marks BUSY, `d` DONE."""
    bench = Bench(load_project(CONFIGS / project, overrides), "sim")
    scans: list[str] = []
    for step in parse_script(script.replace(";", "\n"), bench.project, "script"):
        if not isinstance(step.command, RunScans):
            assert bench.do(step.command) == ""
            continue
        for _ in range(step.command.scans):
            bench.step()
            out = bench.runtime.outputs(instance)
            marks = "!" * out.error + "b" * out.busy + "d" * out.done
            scans.append(f"{out.status:04X}{marks}")
    bench.close()
    runs = [(text, len(list(run))) for text, run in groupby(scans)]
    return " ".join(text if count == 1 else f"{text}{{{count}}}" for text, count in runs)


CONNECT_IDLE = "set TSEND_C_1 CONT=1; run 6"
CONNECT_PASSIVE = "set TRCV_C_1 CONT=1 EN_R=1; run 3; peer P1 connect; run 3"
REFUSED = "peer P1 close; set TSEND_C_1 CONT=1; run 6"

CASES = {
    "retry": (SENDER, "TSEND_C_1", REFUSED + "; run 100", "T#20ms", "7001 7002{2} 80C5! 7001 7002"),
    "attempt_limit": (
        SENDER,
        "TSEND_C_1",
        "link C1 down; set TSEND_C_1 CONT=1; run 16",
        "T#100ms",
        "7001 7002{11} 80C6! 7001 7002{2}",
    ),
    "busy_while_connecting": (
        SENDER,
        "TSEND_C_1",
        CONNECT_IDLE + "; set TSEND_C_1 CONT=0; run 3",
        "true",
        "7001b 7002b{2} 7004{3} 7003b 0003 7000",
    ),
    "status_0001_always": (SENDER, "TSEND_C_1", CONNECT_IDLE, "true", "7001 7002{2} 0001 7004{2}"),
    "teardown_before_error": (
        RECEIVER,
        "TRCV_C_1",
        CONNECT_PASSIVE + "; peer P1 close; run 5",
        "true",
        "7001 7002{2} 0001b 7006b{2} 7003 80C5! 80C4! 7002{2}",
    ),
    "cont_mode": (
        SENDER,
        "TSEND_C_1",
        "pulse TSEND_C_1 REQ; run 9",
        "manual",
        "7001b 7002b{2} 0001b 7005b 0000d 7003 0003 7000",
    ),
    "com_rst_autoclear": (
        SENDER,
        "TSEND_C_1",
        "set TSEND_C_1 CONT=1; run 4; set TSEND_C_1 COM_RST=1; run 3; set TSEND_C_1 COM_RST=1; run 3",
        "false",
        "7001 7002{2} 7004 7003 7002 7004{4}",
    ),
    "rcv_lag": (
        PAIR,
        "TRCV_C_1",
        "set TSEND_C_1 CONT=1; set TRCV_C_1 CONT=1 EN_R=1; run 3; peer P1 connect; run 3",
        "false",
        "7002{3} 0001b 7006b{2}",
    ),
    "silent_connect": (SENDER, "TSEND_C_1", REFUSED, "true", "7001 7002{5}"),
    "en_r_falls": (
        RECEIVER,
        "TRCV_C_1",
        CONNECT_PASSIVE + "; set TRCV_C_1 EN_R=0; run 2",
        "drops",
        "7001 7002{2} 0001b 7006b{2} 7004{2}",
    ),
    "receive_faults": (
        RECEIVER,
        "TRCV_C_1",
        "set TRCV_C_1 LEN=9; " + CONNECT_PASSIVE + "; run 1; set TRCV_C_1 LEN=10; run 2;"
        "set TRCV_C_1 EN_R=0; run 1; set TRCV_C_1 EN_R=1; run 2; set TRCV_C_1 LEN=8; run 2",
        "once",
        "7001 7002{2} 7004 8088! 7004{2} 8088! 7004{2} 8088! 7004 7006b{2}",
    ),
    "buffers": (
        SENDER,
        "TSEND_C_1",
        "set TSEND_C_1 CONT=1; run 4; set TSEND_C_1 REQ=1; run 2",
        "0",
        "7001 7002{2} 7004 80C3! 7004",
    ),
    "queue": (SENDER, "TSEND_C_1", "set TSEND_C_1 CONT=1; run 4", "0", "80C3!{4}"),
    "small_buffers": (
        SENDER,
        "TSEND_C_1",
        "resize tx ARRAY[1..60000] OF BYTE; set TSEND_C_1 CONT=1; run 4; peer P1 stall;"
        "set TSEND_C_1 REQ=1; run 4",
        "true",
        "7001 7002{2} 7004 7005b{4}",
    ),
}


# What no STATUS shows: configs/scenarios/siemens/switch-NAME.toml looks at the wire; and what no pin brings
# about: tests/bench/test_internal_errors.py.
ON_THE_WIRE = {"iso_tpdu_default", "backlog", "internal_fault"}


def test_every_switch_has_a_case() -> None:
    assert set(CASES) | ON_THE_WIRE == {switch.name for switch in SWITCHES}


@pytest.mark.parametrize("name", CASES)
def test_a_switch_changes_what_shows(name: str) -> None:
    project, instance, script, value, expected = CASES[name]
    default = next(format_value(s, s.default) for s in SWITCHES if s.name == name)
    changed = shown(project, instance, script, f"options.{name}={value}")
    unchanged = shown(project, instance, script)
    assert changed == expected if name != "retry" else changed.startswith(expected)
    assert unchanged == shown(project, instance, script, f"options.{name}={default}")
    assert unchanged != changed


# -- without a switch ----------------------------------------------------------------------------------


def test_a_failed_tcon_is_silent_too_and_goes_on_until_the_partner_listens() -> None:
    script = "peer P1 close; pulse TCON_1 REQ; run 6"
    project = "s7-single-active.toml"
    assert shown(project, "TCON_1", script) == "7001b 7002b{2} 80C5! 7000{2}"
    silent = ("options.silent_connect=true", "options.retry=T#20ms")
    assert shown(project, "TCON_1", script, *silent) == "7001b 7002b{5}"
    later = shown(project, "TCON_1", script + "; peer P1 listen; run 5", *silent)
    assert "0000d" in later and "!" not in later


# -- cont_mode manual, the default of the S7-1200 --------------------------------------------------------

MANUAL = "options.cont_mode=manual"
FRAME = "peer P1 send hex 01 02 03 04 05 06 07 08"


def test_the_s7_1200_follows_its_own_manual_the_others_the_status_sequences() -> None:
    for dialect, request_connects in ((S7_1200, True), (S7_1500, False), (S7_1200_LEGACY, False)):
        course = dialect.answer(defaults(dialect)).course
        assert course.request_connects is request_connects, dialect.name
        assert course.en_r_keeps_job is not request_connects, dialect.name
    today = S7_1200.answer({"cont_mode": "level", "en_r_falls": "keeps"}).course
    assert today == S7_1500.answer({}).course


def test_the_older_word_oneshot_still_means_that_the_request_connects() -> None:
    script = "pulse TSEND_C_1 REQ; run 9"
    older = shown(SENDER, "TSEND_C_1", script, "options.cont_mode=oneshot")
    assert older == shown(SENDER, "TSEND_C_1", script, MANUAL)


def test_busy_is_1_from_the_edge_to_done_also_while_an_edge_that_came_early_waits() -> None:
    script = "set TSEND_C_1 CONT=1; run 2; pulse TSEND_C_1 REQ; run 6; set TSEND_C_1 CONT=0; run 3"
    assert shown(SENDER, "TSEND_C_1", script, MANUAL) == (
        "7001 7002 7002b 0001b 7005b 0000d 7004{2} 7003 0003 7000"
    )


def test_an_edge_in_the_scan_in_which_cont_falls_sends_first() -> None:
    script = "set TSEND_C_1 CONT=1; run 4; set TSEND_C_1 CONT=0 REQ=1; run 5"
    assert shown(SENDER, "TSEND_C_1", script, MANUAL) == "7001 7002{2} 7004 7005b 0000d 7003 0003 7000"


def test_a_request_ends_with_its_error_and_disconnects_unless_cont_was_1() -> None:
    script = "peer P1 close; pulse TSEND_C_1 REQ; run 6"
    assert shown(SENDER, "TSEND_C_1", script, MANUAL) == "7001b 7002b{2} 80C5! 7003 7000"
    kept = shown(SENDER, "TSEND_C_1", "set TSEND_C_1 CONT=1; " + script, MANUAL)
    assert kept == "7001b 7002b{2} 80C5! 7001 7002"


def test_a_job_that_is_refused_at_its_edge_ends_the_connection_too_when_cont_was_0() -> None:
    script = "set TSEND_C_1 LEN=9; pulse TSEND_C_1 REQ; run 8"
    assert shown(SENDER, "TSEND_C_1", script, MANUAL) == "7001b 7002b{2} 7004b 8088! 7003 0003 7000"


def test_com_rst_in_a_job_is_its_error_and_the_connection_is_built_again_and_stays() -> None:
    script = (
        "resize tx ARRAY[1..60000] OF BYTE; pulse TSEND_C_1 REQ; peer P1 stall; run 6;"
        "set TSEND_C_1 COM_RST=1; run 6"
    )
    options = MANUAL, "options.small_buffers=true"
    assert shown(SENDER, "TSEND_C_1", script, *options) == (
        "7001b 7002b{2} 0001b 7005b{2} 80A7! 7003 7002 7004{3}"
    )


def test_com_rst_before_the_connection_stands_leaves_the_request_alone() -> None:
    script = "pulse TSEND_C_1 REQ; run 2; set TSEND_C_1 COM_RST=1; run 7"
    assert shown(SENDER, "TSEND_C_1", script, MANUAL) == "7001b 7002b{2} 0001b 7005b 0000d 7003 0003 7000"


def test_en_r_that_falls_before_the_first_data_leaves_the_connection_and_the_bytes() -> None:
    script = (
        f"set TRCV_C_1 EN_R=1; run 3; peer P1 connect; run 2; set TRCV_C_1 EN_R=0; {FRAME}; run 3;"
        "set TRCV_C_1 EN_R=1; run 1; set TRCV_C_1 EN_R=0; run 5"
    )
    assert shown(RECEIVER, "TRCV_C_1", script, MANUAL) == (
        "7001 7002{2} 0001b 7006b 7004{3} 7006b 0000d 7003 0003 7000{2}"
    )


def test_en_r_falls_keeps_lets_a_job_without_data_go_on_as_ever() -> None:
    script = f"{CONNECT_PASSIVE}; set TRCV_C_1 EN_R=0; run 2; {FRAME}; run 4"
    keeps = shown(RECEIVER, "TRCV_C_1", script, MANUAL, "options.en_r_falls=keeps")
    assert keeps == "7001 7002{2} 0001b 7006b{4} 0000d 7004{3}"


def test_cont_that_fell_in_a_job_counts_as_soon_as_en_r_ends_it() -> None:
    script = f"{CONNECT_PASSIVE}; set TRCV_C_1 CONT=0; run 2; set TRCV_C_1 EN_R=0; run 3"
    assert shown(RECEIVER, "TRCV_C_1", script, MANUAL) == "7001 7002{2} 0001b 7006b{4} 7003 0003 7000"


def test_trcv_beside_it_keeps_to_the_same_rule_of_en_r() -> None:
    script = "pulse TCON_1 REQ; set TRCV_1 EN_R=1; run 6; set TRCV_1 EN_R=0; run 2"
    project = "s7-single-active.toml"
    level, manual = shown(project, "TRCV_1", script), shown(project, "TRCV_1", script, MANUAL)
    assert (level.split()[-1][:5], manual.split()[-1]) == ("7002b", "7000{2}")


def test_a_trcv_that_is_refused_shows_it_each_call_or_once() -> None:
    script = (
        "peer P1 close; set TRCV_1 EN_R=1; run 3; pulse TCON_1 REQ; run 2;"
        "set TRCV_1 EN_R=0; run 1; set TRCV_1 EN_R=1; run 1"
    )
    project = "s7-single-active.toml"
    each = shown(project, "TRCV_1", script)
    once = shown(project, "TRCV_1", script, "options.receive_faults=once")
    assert each == "80A1!{3} 80C4!{2} 7000 80A1!"
    assert once == "80A1! 7000{2} 80C4! 7000{2} 80A1!"


def test_the_cpus_differ_in_their_limits() -> None:
    large, small = S7_1500.answer({}), S7_1200.answer({})
    assert (large.max_len, large.max_datagram, large.area.symbolic_bytes) == (65536, 2048, False)
    assert (small.max_len, small.max_datagram, small.area.symbolic_bytes) == (8192, 1472, True)


@pytest.mark.parametrize("opener", ["TSEND_C_1", "TRCV_C_1"])
def test_the_block_that_is_called_second_lags_whichever_has_opened_the_connection(opener: str) -> None:
    other = "TRCV_C_1" if opener == "TSEND_C_1" else "TSEND_C_1"
    script = f"set {opener} CONT=1; run 3; set {other} CONT=1; run 3; peer P1 connect; run 3"
    first, second = (shown(PAIR, name, script).split()[-2:] for name in ("TSEND_C_1", "TRCV_C_1"))
    assert (first[-1], second[-1]) == ("7004{3}", "7004{2}")
