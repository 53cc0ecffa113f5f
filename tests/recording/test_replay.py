"""A run that was recorded runs again, exactly; what differs is an error; bytes of a journal are data."""

from __future__ import annotations

import io
import random
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import pytest

from tests.certificates import NEEDS_OPENSSL
from tests.net.contract import FACTS, Fact
from tests.net.net_bench import Bench as Workbench
from tests.net.sim.net_sim import SimNetwork
from tests.scenario.scenarios import CONFIGS, PatientPace
from trcvtui.bench.bench import Bench
from trcvtui.errors import UserError
from trcvtui.net.kernel import Handle, Kernel
from trcvtui.net.results import Endpoint, Fault
from trcvtui.net.sim.kernel import SimKernel
from trcvtui.plc.ledger import BenchNote
from trcvtui.recording.journal import DO, SKIP, CallRecord, Entry, LedgerNote, decode_entries, encode_blocks
from trcvtui.recording.replay import ReplaySeam
from trcvtui.recording.seam import Seam, SeamRecorder, wrap_kernel
from trcvtui.scenario.report import JsonLines
from trcvtui.scenario.runner import Pace, ScenarioRunner, VirtualPace
from trcvtui.scenario.scenario import load_scenario

MUTATIONS = 1000
BARE = re.compile(r"<TlsError\.\w+: ('\w+')>")  # a word of an enum comes back as the plain word, its equal


def run(path: Path, kernel: str, seam: Seam, pace: Pace) -> tuple[str, list[str]]:
    scenario = load_scenario(path, ())
    bench = Bench(scenario.project, kernel, seam)
    out = io.StringIO()
    report = JsonLines(out.write, bench.runtime.interval_ns)
    verdict = ScenarioRunner(bench, scenario.name, pace, report.write_scan).play(
        (*scenario.start, *scenario.steps)
    )
    report.write_verdict(verdict)
    bench.close()
    assert bench.leaks() == ()
    return out.getvalue(), [BARE.sub(r"\1", str(line)) for line in bench.runtime.ledger]


def recorded(path: Path, kernel: str = "sim") -> tuple[tuple[str, list[str]], list[Entry]]:
    entries: list[Entry] = []
    pace = PatientPace() if kernel == "live" else VirtualPace()
    return run(path, kernel, SeamRecorder(entries.append), pace), entries


@pytest.mark.parametrize(
    ("call", "args"), [(SKIP, ()), (SKIP, ("1",)), (SKIP, (-1,)), (SKIP, (1 << 41,)), (DO, ()), (DO, (1,))]
)
def test_a_journal_with_a_strange_command_ends_there(call: str, args: tuple[object, ...]) -> None:
    with pytest.raises(UserError, match="an answer that this call can give"):
        list(decode_entries(encode_blocks([CallRecord("bench", call, args, None)]), "R"))


@NEEDS_OPENSSL
@pytest.mark.slow
@pytest.mark.parametrize("kernel", ["sim", "live"])
@pytest.mark.parametrize("name", ["tls-server.toml", "tls-client.toml"])
def test_a_replay_of_tls_makes_no_tls(
    secure_bench: Path, name: str, kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen, entries = recorded(secure_bench / name, kernel)

    def never(*_: object) -> None:
        raise AssertionError("a replay has made a session")

    monkeypatch.setattr("trcvtui.net.layers.layer_kernel.LayeredStream.pump", never)
    monkeypatch.setattr("trcvtui.bench.bench.Bench._make_layer_kernel", never)
    replay = ReplaySeam(decode_entries(encode_blocks(entries), "R"), "R")
    assert run(secure_bench / name, kernel, replay, VirtualPace()) == seen


# -- the contract of the seam -----------------------------------------------------------------------------


class Timeless:
    """A network of answers, on which no time passes."""

    def __init__(self, kernel: Kernel) -> None:
        self.kernel = kernel

    def breathe(self) -> None:
        """Do nothing."""


class Watched(SimNetwork):
    """A simulated network that is asked through a recorder."""

    def __init__(self, kernel: SimKernel, seam: Seam) -> None:
        super().__init__(kernel)
        self.seen: Kernel = wrap_kernel(seam, "X", lambda: kernel)


ASKED = [fact for fact in FACTS if not fact.__name__.startswith("a_look")]  # a recorder alone looks


@pytest.mark.parametrize("fact", ASKED, ids=lambda fact: fact.__name__)
def test_a_recording_kernel_and_one_that_answers_keep_the_contract(fact: Fact) -> None:
    entries: list[Entry] = []
    network = Watched(SimKernel(), SeamRecorder(entries.append))
    bench = Workbench(network)
    bench.kernel = network.seen
    fact(bench)
    replay = ReplaySeam(decode_entries(encode_blocks(entries), "R"), "R")
    fact(Workbench(Timeless(wrap_kernel(replay, "X", SimKernel))))
    replay.check_end()


def test_a_journal_from_before_broadcasts_and_of_another_keep_alive_answers_what_it_has() -> None:
    older = [
        CallRecord("C1", "bind", (1, Endpoint("127.0.0.1", 2000)), None),
        CallRecord("C2", "set_options", (2, False, 10, 0, False, False), ()),
    ]
    kernel = wrap_kernel(ReplaySeam(iter(older), "R"), "C1", SimKernel)
    assert kernel.set_broadcast(Handle(1)) == Fault("set_broadcast", "ENOSYS")
    assert kernel.bind(Handle(1), Endpoint("127.0.0.1", 2000)) is None
    for owner, handle in (("C1", 2), ("C2", 3)):
        with pytest.raises(UserError, match="which was recorded"):
            ReplaySeam(iter(older[1:]), "R").ask(owner, "set_options", (handle, False, 30), tuple)
    assert ReplaySeam(iter(older[1:]), "R").ask("C2", "set_options", (2, False, 30), tuple) == ()


# -- what differs -----------------------------------------------------------------------------------------

STORY = CONFIGS / "scenarios" / "baosky" / "80c5-fin-mid-send.toml"


def answered(entries: Iterable[Entry]) -> str:
    with pytest.raises(UserError) as told:
        replay = ReplaySeam(iter(entries), "R")
        run(STORY, "sim", replay, VirtualPace())
        replay.check_end()
    return str(told.value)


def changed(call: str, change: Callable[[CallRecord], CallRecord]) -> list[Entry]:
    """Return the journal of the story with the first entry of a call changed."""
    _, entries = recorded(STORY)
    at = next(at for at, one in enumerate(entries) if isinstance(one, CallRecord) and one.call == call)
    one = entries[at]
    assert isinstance(one, CallRecord)
    return [*entries[:at], change(one), *entries[at + 1 :]]


def test_another_call_is_told_with_scan_owner_and_call() -> None:
    entries = changed("send", lambda one: one._replace(call="another"))
    calls = [one.call for one in entries if isinstance(one, CallRecord)]
    said = answered(entries)
    assert said.startswith(f"R: scan {calls[: calls.index('another')].count('step')}: found send (")
    assert "of C1, expected another (" in said


def test_other_bytes_are_told_although_they_are_as_many() -> None:
    entries = changed("send", lambda one: one._replace(args=(*one.args[:2], 1)))
    assert "found send (" in answered(entries)


@pytest.mark.parametrize(
    ("call", "answer"), [("socket", "x"), ("recv", 5), ("recv", (3, b"")), ("step", None)]
)
def test_an_answer_that_the_call_cannot_give_is_told(call: str, answer: object) -> None:
    entries = changed(call, lambda one: one._replace(answer=answer))
    assert "an answer" in answered(decode_entries(encode_blocks(entries), "R"))


def test_a_journal_that_ends_too_early_and_one_that_goes_on_are_told() -> None:
    _, entries = recorded(STORY)
    assert "the end of the journal" in answered(entries[: len(entries) // 2])
    assert "nothing more" in answered([*entries, CallRecord("C1", "poll", (), None)])


# -- bytes ------------------------------------------------------------------------------------------------


def test_a_newer_version_and_a_missing_block_are_told() -> None:
    block = bytearray(next(encode_blocks([CallRecord("C1", "poll", (), None)])))
    second = bytes(block)
    assert "block 0, expected block 1" in wrong([second, second])
    block[16] = 9
    assert wrong([bytes(block)]).startswith("R: journal: found version 9")


def wrong(found: Sequence[bytes]) -> str:
    with pytest.raises(UserError) as told:
        list(decode_entries(found, "R"))
    return str(told.value)


def mutated(block: bytes, seed: int) -> bytes:
    dice = random.Random(seed)
    made = bytearray(block)
    for _ in range(dice.randint(1, 4)):
        at = dice.randrange(len(made))
        match dice.randrange(4):
            case 0:
                made[at] = dice.randrange(256)
            case 1:
                made[at : at + 4] = dice.choice([b"\xff" * 4, b"\0" * 4, b"\xff\xff\xff\x7f"])
            case 2:
                del made[at : at + dice.randint(1, 20)]
            case _:
                made[at:at] = made[dice.randrange(len(made)) :][:20]
    return bytes(made)


def read(found: Iterator[Entry]) -> bool:
    """Return whether a journal was read to its end; a UserError in one line is the other way to end."""
    try:
        for entry in found:
            assert isinstance(entry, CallRecord | LedgerNote)
    except UserError as told:
        assert "\n" not in str(told) and len(str(told)) < 400
        return False
    return True


def test_a_thousand_mutated_journals_are_read_or_refused_in_one_line() -> None:
    _, entries = recorded(STORY)
    note = BenchNote("C1", "link up", "\udcff")
    block = next(encode_blocks([*entries[:200], note]))
    ended = [read(decode_entries([mutated(block, seed)], "R")) for seed in range(MUTATIONS)]
    assert not all(ended)


def test_a_mutated_journal_that_can_be_read_is_a_difference_and_no_crash() -> None:
    _, entries = recorded(STORY)
    block = next(encode_blocks(entries))
    refused = 0
    for seed in range(100):
        try:
            run(STORY, "sim", ReplaySeam(decode_entries([mutated(block, seed)], "R"), "R"), VirtualPace())
        except UserError as told:
            refused += 1
            assert str(told).startswith("R: ")
    assert refused > 50


def test_tuples_in_tuples_end_at_a_depth() -> None:
    head = next(encode_blocks([]))[:-4] + b"\x01\0\0\0"
    assert "deep" in wrong([head + b"\x06\x01\x00" * 5000])
