"""TSEND_C and the inner blocks, scan by scan, where one scenario file could not say it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.commands.table import parse_script
from trcvtui.plc.ledger import Outputs
from trcvtui.project.file import load_project
from trcvtui.scenario.runner import Runner, VirtualPace

UP = "set TSEND_C_1 CONT=1\nwait TSEND_C_1 STATUS=7004\n"


def traces(project: str, steps: str, *overrides: str) -> dict[str, str]:
    """Return the STATUS of every scan of each instance, from the first on, on the simulated kernel."""
    bench = Bench(load_project(CONFIGS / f"{project}.toml", overrides), "sim")
    script = parse_script(steps, bench.project, "steps")
    verdict = Runner(bench, "test", VirtualPace(), lambda *what_passed: None).play(script)
    bench.close()
    assert bench.leaks() == ()
    assert verdict.failures == ()
    return dict(verdict.traces)


def sender(steps: str, *overrides: str, project: str = "sender") -> str:
    return traces(project, steps, *overrides)["TSEND_C_1"]


# -- an edge of REQ without a connection ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scan", "shown"),
    [
        (1, "0001 7001 7002 80A1! 7002{4}"),  # together with CONT
        (2, "0001 7001 7002 80A1! 7002{4}"),
        (3, "0001 7001 7002 80A1! 7002{4}"),
        (4, "0001 7001 7002 80A1! 7002{4}"),
        (5, "0001 7001 7002{2} 80A1! 7002{3}"),
    ],
)
def test_row_4_an_edge_waits_for_the_second_7002_and_is_told_once(scan: int, shown: str) -> None:
    before = f"run {scan - 1}\n" if scan > 1 else ""
    steps = f"set TSEND_C_1 CONT=1\n{before}pulse TSEND_C_1 REQ\nrun {9 - scan}"
    assert sender(steps, project="passive-sender") == shown


def test_row_4_several_edges_before_the_second_7002_are_told_once() -> None:
    steps = "set TSEND_C_1 CONT=1 REQ=1\nrun 1\nset TSEND_C_1 REQ=0\nrun 1\nset TSEND_C_1 REQ=1\nrun 5"
    assert sender(steps, project="passive-sender") == "0001 7001 7002 80A1! 7002{3}"


def test_row_4_an_edge_that_waits_is_told_instead_of_the_first_7004_when_the_partner_is_quick() -> None:
    assert sender("set TSEND_C_1 CONT=1 REQ=1\nrun 7") == "0001 7001 7002 80A1! 7004{3}"


def test_row_4_a_falling_cont_forgets_the_edge() -> None:
    steps = "set TSEND_C_1 CONT=1 REQ=1\nrun 2\nset TSEND_C_1 CONT=0\nrun 2\nset TSEND_C_1 CONT=1\nrun 6"
    assert sender(steps, project="passive-sender") == "0001 7001 7003 7000 0001 7001 7002{4}"


@pytest.mark.parametrize("scan", [1, 2, 3])
def test_row_4_an_edge_while_a_reset_shows_is_told_after_it(scan: int) -> None:
    before = f"run {scan - 1}\n" if scan > 1 else ""
    steps = UP + f"pulse TSEND_C_1 COM_RST\n{before}pulse TSEND_C_1 REQ\nrun {8 - scan}"
    assert sender(steps) == "0001 7001 7002 7004 8000 7003 7007 7002 80A1! 7004{2}"


def test_row_4_an_80a0_wins_its_scan_and_80a1_takes_the_next_7002() -> None:
    steps = "peer P1 close\nset TSEND_C_1 CONT=1 REQ=1\nrun 7"
    assert sender(steps) == "0001 7001 7002 80A0! 80A1! 7002{2}"


# -- one job -------------------------------------------------------------------------------------------------


def test_row_6_never_two_of_busy_done_and_error_and_each_pulse_lasts_one_scan() -> None:
    bench = Bench(load_project(CONFIGS / "sender.toml"), "sim")
    seen: list[tuple[str, bool, bool, bool, int | None]] = []

    def note(*what_passed: object) -> None:
        out: Outputs = bench.runtime.outputs("TSEND_C_1")
        seen.append((f"{out.status:04X}", out.busy, out.done, out.error, out.rcvd_len))

    steps = UP + "pulse TSEND_C_1 REQ\nrun 3\nset TSEND_C_1 LEN=9\npulse TSEND_C_1 REQ\nrun 2"
    Runner(bench, "one job", VirtualPace(), note).play(parse_script(steps, bench.project, "steps"))
    bench.close()
    assert seen[3:] == [
        ("7004", False, False, False, None),
        ("7005", True, False, False, None),
        ("7009", False, True, False, None),
        ("7004", False, False, False, None),
        ("80A5", False, False, True, None),
        ("7004", False, False, False, None),
    ]


def test_row_6_an_edge_in_the_scan_of_7009_is_ignored_and_the_next_one_sends_at_once() -> None:
    steps = UP + "pulse TSEND_C_1 REQ\nrun 1\npulse TSEND_C_1 REQ\nrun 1\nrun 1\n"
    again = "pulse TSEND_C_1 REQ\nrun 2\nset TSEND_C_1 REQ=0\nrun 1\npulse TSEND_C_1 REQ\nrun 2"
    assert sender(steps + again) == "0001 7001 7002 7004 7005 7009 7004 7005 7009 7004 7005 7009"


def test_row_6_data_that_is_written_in_the_scan_of_the_edge_is_sent_and_later_data_is_not() -> None:
    steps = UP + 'write tx text "abcdefgh"\npulse TSEND_C_1 REQ\nrun 1\nwrite tx text "ABCDEFGH"\nrun 2\n'
    sender(steps + 'expect peer P1 received text "abcdefgh"')


def test_row_6_an_error_of_the_first_send_replaces_the_7005() -> None:
    steps = UP + "fault send ECONNRESET on C1\npulse TSEND_C_1 REQ\nrun 3"
    assert sender(steps) == "0001 7001 7002 7004 80A9! 7002 7004"


# -- the loss before a job, a full buffer --------------------------------------------------------------------


@pytest.mark.parametrize(("end", "shown"), [("close", "80C5!"), ("rst", "80A9!")])
def test_row_9_a_loss_after_the_last_byte_is_no_7009(end: str, shown: str) -> None:
    steps = UP + f"pulse TSEND_C_1 REQ\nrun 1\npeer P1 {end}\nrun 3"
    assert sender(steps) == f"0001 7001 7002 7004 7005 {shown} 7002 7004"


@pytest.mark.parametrize("end", ["close", "rst"])
def test_row_9_a_loss_after_7009_is_no_error(end: str) -> None:
    steps = UP + f"pulse TSEND_C_1 REQ\nrun 2\npeer P1 {end}\nrun 3"
    assert sender(steps) == "0001 7001 7002 7004 7005 7009 7002{2} 7004"


def test_row_18_a_stack_that_takes_nothing_is_80a8_at_the_edge_and_7005_after_the_first_byte() -> None:
    at_the_edge = UP + "fault send EAGAIN on C1\npulse TSEND_C_1 REQ\nrun 2"
    assert sender(at_the_edge) == "0001 7001 7002 7004 80A8! 7004"
    part = "peer P1 stall\nresize tx ARRAY[1..60000] OF BYTE\npulse TSEND_C_1 REQ\nrun 40"
    small = "options.small_buffers=true"
    assert sender(UP + part, small) == "0001 7001 7002 7004 7005{40}"


# -- two blocks on one CONNECT -------------------------------------------------------------------------------

BOTH = """
set TRCV_C_1 CONT=1 EN_R=1
set TSEND_C_1 CONT=1
run 3
peer P1 connect
run 2
expect TRCV_C_1 trace 0001 7001 7002 7004 7006
expect TSEND_C_1 trace 7002{3} 7004{2}
"""


def both(act: str, receiver: str, sender: str) -> None:
    """Bring both blocks up on one CONNECT, act, and expect their traces from then on."""
    traces("duplex", f"{BOTH}{act}\nexpect TRCV_C_1 trace {receiver}\nexpect TSEND_C_1 trace {sender}")


@pytest.mark.parametrize(
    ("trouble", "receiver", "sender"),
    [
        ("peer P1 rst", "80AA! 7002{2}", "7002{3}"),
        ("peer P1 close", "80C5! 7002{2}", "7002{3}"),
        ("fault recv ETIMEDOUT on C1", "80AB! 7002{2}", "80AB! 7002{2}"),
        ("peer P1 send hex 01\npeer P1 close", "7006 80A6! 80C5!", "7004 7002{2}"),
    ],
)
def test_row_22_one_cause_and_each_block_shows_what_its_own_job_makes_of_it(
    trouble: str, receiver: str, sender: str
) -> None:
    both(f"{trouble}\nrun 3", receiver, sender)


@pytest.mark.parametrize(
    ("act", "receiver", "sender"),
    [
        ("set TSEND_C_1 CONT=0", "7006 7002{3}", "7003 7007 7000{2}"),
        ("pulse TSEND_C_1 COM_RST", "7006 7002{3}", "8000 7003 7007 7002"),
        ("set TRCV_C_1 CONT=0", "7003 7007 7000{2}", "7002{4}"),
        ("set TRCV_C_1 CONT=0\nset TSEND_C_1 CONT=0", "7003 7007 7000{2}", "7003 7000{3}"),
    ],
)
def test_row_23_who_still_wants_the_connection_goes_to_7002_without_error(
    act: str, receiver: str, sender: str
) -> None:
    both(f"{act}\nrun 4", receiver, sender)


def test_row_23_a_send_job_whose_connection_the_other_block_closes_ends_without_done_or_error() -> None:
    both("pulse TSEND_C_1 REQ\nrun 1\nset TRCV_C_1 CONT=0\nrun 3", "7006 7003 7007 7000", "7005 7002{3}")


# -- the inner blocks ----------------------------------------------------------------------------------------

TCON = "pulse TCON_1 REQ\nwait TCON_1 STATUS=7004\nrun 1\n"


@pytest.mark.parametrize("closer", ["TDISCON_1", "T_RESET_1"])
def test_a_send_job_whose_connection_another_block_ends_shows_no_error(closer: str) -> None:
    up = "pulse TCON_1 REQ\nrun 3\npeer P1 connect\nrun 2\n"
    steps = f"{up}pulse TSEND_1 REQ\nrun 1\npulse {closer} REQ\nrun 4"
    # TSEND is called first: in the scan of the edge its job still ends well, or goes on.
    small = "resize tx ARRAY[1..60000] OF BYTE\nrun 1\npeer P1 stall\n"
    assert traces("inner-passive", steps)["TSEND_1"] == "7000{3} 7004{2} 7005 7009 7000{3}"
    shown = traces("inner-passive", small + steps, "options.small_buffers=true")["TSEND_1"]
    assert shown == "7000{4} 7004{2} 7005{2} 7000{3}"


def test_t_reset_alone_builds_anew_what_tcon_has_left() -> None:
    found = traces(
        "inner-active", TCON + "delete TCON_1\npulse T_RESET_1 REQ\nrun 7\nexpect peer P1 connected"
    )
    assert found["T_RESET_1"] == "7002{3} 7004{2} 8000 7003 7007 7002{2} 7004{2}"


def test_t_reset_leaves_a_connection_alone_that_tdiscon_has_ended_after_it() -> None:
    steps = TCON + "pulse T_RESET_1 REQ\nrun 4\npulse TDISCON_1 REQ\nrun 5\nexpect peer P1 closed"
    assert traces("inner-active", steps)["T_RESET_1"].endswith("0000{4}")


def test_a_deleted_tsend_in_mid_job_keeps_the_connect_from_a_tsend_c_too() -> None:
    steps = (
        TCON + "resize tx ARRAY[1..60000] OF BYTE\npeer P1 stall\npulse TSEND_1 REQ\nrun 2\ndelete TSEND_1\n"
        "create TSEND_C S connect=C1 data=rx CONT=1\nrun 3\npulse S REQ\nrun 2"
    )
    found = traces("inner-active", steps, "options.small_buffers=true")
    assert found["S"] == "7002 7004{2} 80C3! 7004"


@pytest.mark.parametrize("project", ["inner-active", "inner-passive", "duplex", "sender", "passive-sender"])
def test_the_projects_that_scenarios_share_can_be_opened_by_themselves(project: str) -> None:
    path: Path = CONFIGS / f"{project}.toml"
    assert traces(project, "run 3").keys() == {decl.name for decl in load_project(path).instances}
