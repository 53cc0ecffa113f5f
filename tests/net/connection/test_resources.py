"""The units of one scan: who gets how many, who comes first the next time, and when it is told."""

from __future__ import annotations

from trcvtui.net.connection.resources import EPISODE_REST_NS, LEAST_SHARE_UNITS, BudgetShare, ScanBudget
from trcvtui.net.events import EventKind

MS = 1_000_000
SCAN = 10 * MS


class Told:
    """Work whose clock a test moves, and what it has said."""

    def __init__(self, interval_ns: int = SCAN) -> None:
        self.time = self.now = 0
        self.said: list[tuple[str, EventKind]] = []
        self.words: list[str] = []
        self.work = ScanBudget(lambda: self.time, interval_ns)
        self.work.report_wait = self._hear
        self.scan()

    def _hear(self, owner: str, what: EventKind, partner: str, why: str) -> None:
        self.said.append((owner, what))
        self.words.append(why)

    def scan(self, ns: int = SCAN) -> None:
        self.now += ns
        self.work.begin_scan(self.now)

    def party(self, owner: str) -> BudgetShare:
        return BudgetShare(self.work, owner, EventKind.TPDUS_WAIT)

    def step(self, party: BudgetShare, ns: int) -> None:
        def takes() -> int:
            self.time += ns
            return 1

        self.work.run_handshake_step(party, "", takes)


def greedy(party: BudgetShare) -> int:
    """Use all that the party has, and want more."""
    used = max(party.units_left, 0)
    party.spend(used)
    party.note_waiting()
    return used


def test_a_party_takes_at_most_half_of_the_rest_so_that_nobody_comes_to_nothing() -> None:
    bench = Told()
    total = bench.work.units
    used = [greedy(bench.party(name)) for name in ("C1", "C2", "C3")]
    assert used == [total // 2, total // 4, (total // 4 + 1) // 2]


def test_who_had_to_wait_gets_an_equal_share_whoever_comes_first() -> None:
    bench = Told()
    parties = [bench.party(f"C{n}") for n in range(4)]
    for party in parties:
        greedy(party)
    for order in (parties, parties[::-1], parties):
        bench.scan()
        assert {greedy(party) for party in order} == {bench.work.units // 5}


def test_a_newcomer_finds_a_rest_beside_those_who_always_want_more() -> None:
    bench = Told()
    hungry = [bench.party(f"C{n}") for n in range(7)]
    for _ in range(3):
        for party in hungry:
            greedy(party)
        bench.scan()
    assert bench.party("good").units_left >= bench.work.units // 8 // 2


def test_more_parties_than_there_are_shares_take_turns() -> None:
    bench = Told()
    parties = [bench.party(f"C{n}") for n in range(100)]
    got = dict.fromkeys(parties, 0)
    for _ in range(16):
        used = [greedy(party) for party in parties]
        assert sum(used) <= bench.work.units
        got = {party: got[party] + one for party, one in zip(parties, used, strict=True)}
        bench.scan()
    assert min(got.values()) >= LEAST_SHARE_UNITS


def test_one_step_may_be_dearer_than_what_is_left_and_is_the_last() -> None:
    bench = Told()
    party = bench.party("C1")
    while party.units_left > 0:
        party.spend(16)
    assert (
        bench.work.units // 2
        <= bench.work.units - bench.party("C2").units_left * 2
        <= bench.work.units // 2 + 16
    )


def test_the_units_follow_the_interval() -> None:
    assert Told(SCAN).work.units == 500
    assert Told(MS).work.units == 50


def test_it_is_told_once_an_episode() -> None:
    bench = Told()
    party = bench.party("C1")
    for _ in range(500):
        greedy(party)
        bench.scan()
    assert bench.said == [("C1", EventKind.TPDUS_WAIT)]
    bench.scan(EPISODE_REST_NS)
    greedy(party)
    assert bench.said == [("C1", EventKind.TPDUS_WAIT)] * 2


def test_one_step_a_scan_is_taken_however_long_it_is_and_the_ledger_says_so() -> None:
    bench = Told(MS)
    party = bench.party("C1")
    for _ in range(3):
        assert bench.work.may_handshake()
        bench.step(party, 900_000)
        assert not bench.work.may_handshake()
        bench.scan(MS)
    assert bench.said == [("C1", EventKind.LONG_HANDSHAKE)]
    assert bench.words == ["one step took 0.9 ms; handshakes have 0.1 ms of the 1 ms of a scan"]
