"""What blocks show scan by scan, simulated, where no scenario file says it: tests/golden/traces.txt.

`b` marks BUSY, `d` DONE, `!` ERROR. A case is a project, its instances, what is changed in it, and steps.
"""

from __future__ import annotations

from itertools import groupby

from tests import golden
from tests.scenario.scenarios import CONFIGS, failures
from trcvtui.bench.bench import Bench
from trcvtui.commands.table import parse_line, parse_script
from trcvtui.dialects.dialect import defaults, format_value
from trcvtui.dialects.siemens.rules import S7_1200, S7_1200_LEGACY, S7_1500, SWITCHES
from trcvtui.project.file import load_project
from trcvtui.scenario.runner import ScenarioRunner

# What no STATUS shows: configs/scenarios/siemens/switch-NAME.toml looks at the wire; and what no pin brings
# about: tests/bench/test_internal_errors.py.
ON_THE_WIRE = {"iso_tpdu_default", "backlog", "internal_fault"}


class NotedPace:
    """Each scan is called, and what the instances show after it is noted."""

    def __init__(self, names: list[str]) -> None:
        self.shown: dict[str, list[str]] = {name: [] for name in names}

    def next_scan(self, bench: Bench) -> None:
        bench.step()
        for name, texts in self.shown.items():
            if bench.runtime.snapshot().instance(name) is not None:
                out = bench.runtime.outputs(name)
                texts.append(f"{out.status:04X}{'!' * out.error}{'b' * out.busy}{'d' * out.done}")


def shown(case: str, *overrides: str) -> list[str]:
    """Return what each instance showed, as `7001 7002{2}`; `overrides` replace those of the case."""
    head, _, steps = case.partition(" | ")
    project, names, *own = head.split()
    bench = Bench(load_project(CONFIGS / f"{project}.toml", overrides or own), "sim")
    pace = NotedPace(names.split(","))
    script = parse_script(steps.replace("; ", "\n"), bench.project, "steps")
    verdict = ScenarioRunner(bench, "test", pace, lambda *_: None).play(script)
    bench.close()
    assert bench.leaks() == () and verdict.has_passed, failures(verdict)
    return [collapsed(texts) for texts in pace.shown.values()]


def collapsed(scans: list[str]) -> str:
    runs = [(text, len(list(run))) for text, run in groupby(scans)]
    return " ".join(text if count == 1 else f"{text}{{{count}}}" for text, count in runs)


def test_blocks_show_scan_by_scan_what_the_list_says() -> None:
    golden.answers("scan by scan", shown, "traces")


def test_each_switch_of_siemens_changes_what_shows() -> None:
    golden.answers("switches of Siemens", shown, "traces")
    cases = {
        kind.removeprefix("switch "): case for kind, case in golden.cases("traces", "switches of Siemens")
    }
    assert set(cases) | ON_THE_WIRE == {switch.name for switch in SWITCHES}
    first = {switch.name: format_value(switch, switch.default) for switch in SWITCHES}
    wrong = []
    for name, case in cases.items():
        head, _, steps = case.partition(" | ")
        bare = f"{' '.join(head.split()[:2])} | {steps}"
        unchanged = shown(bare, f"options.{name}={first[name]}")
        if unchanged != shown(bare) or unchanged == shown(case):
            wrong.append(name)
    assert wrong == []


def test_the_s7_1200_follows_its_own_manual_the_others_the_status_sequences() -> None:
    for dialect, request_connects in ((S7_1200, True), (S7_1500, False), (S7_1200_LEGACY, False)):
        course = dialect.answer(defaults(dialect)).course
        assert course.request_connects is request_connects, dialect.name
        assert course.en_r_keeps_job is not request_connects, dialect.name
    today = S7_1200.answer({"cont_mode": "level", "en_r_falls": "keeps"}).course
    assert today == S7_1500.answer({}).course


def test_the_cpus_differ_in_their_limits() -> None:
    large, small = S7_1500.answer({}), S7_1200.answer({})
    assert (large.max_len, large.max_datagram, large.area.symbolic_bytes) == (65536, 2048, False)
    assert (small.max_len, small.max_datagram, small.area.symbolic_bytes) == (8192, 1472, True)


def test_a_partner_that_takes_us_and_drops_us_at_once_is_called_once_in_each_pause() -> None:
    bench = Bench(load_project(CONFIGS / "s7-sender.toml"), "sim")
    lines = "set TSEND_C_1 CONT=1", "peer P1 close"
    calls, drops = (parse_line(line, bench.project, "here") for line in lines)
    assert calls is not None and drops is not None
    bench.do(calls)
    for _ in range(800):  # 8 s
        bench.step()
        link = bench.runtime.snapshot().connections[0]
        if link.state == "connected":
            bench.do(drops)
    bench.close()
    assert (link.attempts, link.incarnation) == (8, 8)
