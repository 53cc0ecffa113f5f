"""Each scenario file holds on its kernels; what is on record of that one run gives it again."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import pytest
from msgspec import Struct

from tests.replay.journals import again, jsonl, what_if_nothing_changed
from tests.scenario.scenarios import (
    BAOSKY,
    CONFIGS,
    LEGACY,
    SCENARIOS,
    SIEMENS,
    SIM_ONLY,
    STORIES,
    TWINCAT,
    Played,
    failures,
    play,
    played,
)
from trcvtui.blocks.status import Reproducibility, StatusRow
from trcvtui.commands import words
from trcvtui.diagnosis.advice import describe_cause
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.siemens.connection_errors import LEGACY_ERRORS
from trcvtui.dialects.siemens.rules import OWN_ROWS
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.project.file import load_project
from trcvtui.replay.command import find_difference
from trcvtui.scenario.scenario import load_scenario, read_scenario_file
from trcvtui.scenario.scenario_index import read_shown_codes
from trcvtui.snapshots.scenario import FAILED

A_MINUTE = "four-bytes-short"  # of real time
ANY_PORT = {"packed-sender": ("connect.C1.LocalPort=0",)}  # its own is that of the README: it may be in use
# What pins alone decide is the same code on both kernels.
LIVE = [
    *BAOSKY,
    *(p for p in SIEMENS + LEGACY if p.stem[0] == "1" or p.stem.startswith(("80c", "udp", "iso"))),
    *(path for path in TWINCAT if path.stem.startswith(("6-", "barcode"))),
    *(path for path in STORIES if path.stem != A_MINUTE),
]
# How long these last is the link's business; with Siemens 80A1 and 80C4 of a TRCV that waits for it, too.
OF_THE_LINK = {
    "baosky": ("7002", "7004", "7005", "7006"),
    "siemens": ("7001", "7002", "7004", "7005", "7006", "80A1", "80C4"),
}
OF_THE_LINK["siemens-legacy"] = OF_THE_LINK["siemens"]
ASKED_WHAT_IF = ("80a6-short-frame-80c5", "80c5-fin-mid-send", "udp-7006-7008-receive")
WORD = re.compile(r"<TlsError\.\w+: ('\w+')>")  # a word of an enum comes back as the plain word, its equal


def name_of(path: Path) -> str:
    return f"{path.parent.name}/{path.stem}"


@pytest.mark.slow
@pytest.mark.parametrize("path", SCENARIOS, ids=name_of)
def test_a_scenario_on_the_simulated_network(path: Path) -> None:
    run = played(path)
    assert run.verdict.has_passed, failures(run.verdict)
    file_says_what_the_bench_does(path)
    table_lists_each_code(path, run)
    no_text_says_none(run)
    replay_is_the_same(run)
    what_if_nothing_changed(run.entries)
    called = play(path, "sim", calls_all=True)
    assert called.text == run.text, "instances that are called in each scan show something else"
    assert called.events == run.events
    steps_one_by_one_are_the_same(path, run)


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.parametrize("path", LIVE, ids=name_of)
def test_a_scenario_on_real_sockets(path: Path) -> None:
    run = play(path, "live", *ANY_PORT.get(path.stem, ()), is_recorded=True)
    assert run.verdict.has_passed, failures(run.verdict)
    table_lists_each_code(path, run)
    replay_is_the_same(run)
    if path.stem in ASKED_WHAT_IF:
        what_if_nothing_changed(run.entries)
    if path.parent.name in OF_THE_LINK:
        sim = played(path)
        waits = OF_THE_LINK[path.parent.name]
        assert walk(run.records(), waits) == walk(sim.records(), waits)
    if path in BAOSKY:
        assert run.causes() == sim.causes()


def walk(
    records: list[dict[str, object]], waits: tuple[object, ...] = OF_THE_LINK["baosky"]
) -> dict[object, list[tuple[object, ...]]]:
    """Return what each instance showed, in order; what waits for the link counts once."""
    walks: dict[object, list[tuple[object, ...]]] = {}
    for record in records:
        shown = (record["STATUS"], record["BUSY"], record["DONE"], record["ERROR"], record.get("RCVD_LEN"))
        steps = walks.setdefault(record["instance"], [])
        if record["STATUS"] not in waits or not steps or steps[-1] != shown:
            steps.append(shown)
    return walks


# -- what is claimed of a run -------------------------------------------------------------------------------


def file_says_what_the_bench_does(path: Path) -> None:
    """Each step stands at its place in the file; the shelf reads its codes as the bench does."""
    said, text = read_scenario_file(path), path.read_text(encoding="utf-8")
    assert said is not None and not said.problem
    if "\\" not in text:  # where a step is written otherwise, places count from the first step
        lines = text.splitlines()
        assert [line.text for line in said.lines] == [lines[line.place - 1].strip() for line in said.lines]
    scenario = load_scenario(path)
    blocks_of = {decl.name: decl.block for decl in scenario.project.instances}
    assert read_shown_codes(path) == codes_expected(scenario.steps, blocks_of)


def codes_expected(steps: Iterable[words.Step], blocks_of: dict[str, str]) -> set[tuple[int, str]]:
    found: set[tuple[int, str]] = set()
    for step in steps:
        match step.command:
            case words.ExpectTrace(name, pattern):
                scans = [atom.scan for atom in pattern.atoms if atom.scan is not None and atom.least]
                found |= {(status, blocks_of[name]) for status, _ in scans}
            case words.Wait(words.PinsAre(name, pins), _) | words.Expect(words.PinsAre(name, pins), _):
                found |= {(int(value), blocks_of[name]) for pin, value in pins if pin == "STATUS"}
            case words.CreateBlock(decl):
                blocks_of[decl.name] = decl.block
    return found


def table_lists_each_code(path: Path, run: Played) -> None:
    dialect = load_scenario(path).project.dialect
    shown = {(edge.block, edge.outputs.status) for edge in run.edges}
    assert [f"{block} {code:04X}" for block, code in shown if dialect.row(code, block) is None] == []


def no_text_says_none(run: Played) -> None:
    """No text of an event, and no reason of a STATUS, has Python's None for an address that is not there."""
    texts = [*texts_in(run.events), *(describe_cause(edge.cause, edge.block) for edge in run.edges), run.text]
    assert [text for text in texts if re.search(r"\bNone\b", text)] == []


def texts_in(value: object) -> Iterable[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, tuple | list):
        for each in value:
            yield from texts_in(each)
    elif isinstance(value, Struct):
        yield from texts_in([getattr(value, name) for name in value.__struct_fields__])


def replay_is_the_same(run: Played) -> None:
    """Run it again from the bytes of its journal: as its steps, which print, and as its commands alone."""
    assert jsonl(run.entries) == run.text
    commanded = again(run.entries)
    assert find_difference(commanded) == ""
    told = [WORD.sub(r"\1", str(line.event)) for line in commanded.bench.runtime.ledger]
    assert told == [WORD.sub(r"\1", str(event)) for event in run.events]


def steps_one_by_one_are_the_same(path: Path, run: Played) -> None:
    console = Controller(fresh_bench(load_project(CONFIGS / "passive.toml"), "sim"))
    console.handle_line(1, f"scenario load {path} sim")
    assert console.player is not None
    while not console.player.is_finished:
        console.handle_line(2, "scenario step")
        while console.player.wants_scan:
            console.scan()
    player = console.player.snapshot()
    assert FAILED not in [step.state for step in player.steps]
    assert console.bench.runtime.scans == run.verdict.scans
    for (name, newest), (known, whole) in zip(player.traces, run.verdict.traces, strict=True):
        assert name == known
        assert whole.endswith(newest.removeprefix("... "))
    console.bench.close()


# -- which codes are shown ----------------------------------------------------------------------------------

Shown = frozenset[tuple[str, int, bool]]
TCP_BLOCKS = ("TRCV_C", "TSEND_C", "TCON", "TDISCON", "T_RESET", "TSEND", "TRCV")
# What no ordinary socket does, and 8086 (it would take the process's last
# descriptor): everything else that a _C block shows is brought about by its own condition.
ONLY_INJECTED = ["16#8082", "16#8084", "16#8086", "16#8087"]


def shown_in(paths: Iterable[Path]) -> Shown:
    return frozenset().union(*(played(path).reached() for path in paths))


def unseen(rows: Iterable[StatusRow], seen: set[tuple[str, int]]) -> list[str]:
    return [
        f"{row.word} {'/'.join(row.blocks)}"
        for row in rows
        if row.reach is not Reproducibility.NEVER and not seen & {(block, row.code) for block in row.blocks}
    ]


@pytest.mark.slow
def test_each_block_of_baosky_shows_all_its_table_lists_and_nothing_else() -> None:
    ours = [path for path in SIM_ONLY if load_scenario(path).project.dialect.name == "baosky"]
    shown = shown_in(BAOSKY + ours)
    rows = DIALECTS["baosky"].status
    listed = {(block, row.code) for row in rows for block in row.blocks if block in TCP_BLOCKS}
    assert {(block, code) for block, code, _ in shown if block in TCP_BLOCKS} == listed
    for block in ("TRCV_C", "TSEND_C"):
        real = {code for of, code, injected in shown if of == block and not injected}
        assert [row.word for row in rows if block in row.blocks and row.code not in real] == ONLY_INJECTED


@pytest.mark.slow
def test_blocks_of_siemens_show_what_a_condition_can_reach_and_nothing_else(secure_bench: Path) -> None:
    shown = shown_in([*SIEMENS, *secure_bench.glob("tls-*.toml")])
    rows = [row for row in DIALECTS["s7-1500"].status if row.reach is not Reproducibility.NEVER]
    seen = {(block, code) for block, code, _ in shown}
    assert unseen(rows, seen) == []
    assert seen - {(block, row.code) for row in rows for block in row.blocks} == set()
    real = {(block, code) for block, code, injected in shown if not injected}
    only_injected = [row.word for row in rows if not real & {(block, row.code) for block in row.blocks}]
    assert only_injected == [row.word for row in rows if row.reach is Reproducibility.INJECTED]


@pytest.mark.slow
def test_what_instructions_before_3_show_otherwise_has_a_scenario() -> None:
    seen = {(block, code) for block, code, _ in shown_in(LEGACY)}
    assert unseen((*OWN_ROWS, *LEGACY_ERRORS), seen) == []


def test_each_table_of_a_manual_has_a_scenario() -> None:
    stems = [path.stem for path in SIEMENS + LEGACY + TWINCAT]
    starts = [f"1-{number}-" for number in range(1, 12)]
    starts += [*(f"3-{row:02}-" for row in range(1, 15)), *(f"6-t{row:02}-" for row in range(1, 10))]
    assert [start for start in starts if not any(f"{stem}-".startswith(start) for stem in stems)] == []
