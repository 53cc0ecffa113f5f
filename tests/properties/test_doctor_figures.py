"""How often the doctor is right, on generated captures whose seeds tuned nothing.

TRCVTUI_SOAK takes 40 seeds, prints the figures and a reliability table; the suite takes two.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from tests.diagnosis.doctor_cases import (
    LATE,
    Built,
    faults,
    healthy,
    in_noise,
    in_the_middle,
    two_faults,
    verdicts_of,
)

IS_SOAK = "TRCVTUI_SOAK" in os.environ
OF_THREE = 0.99 if IS_SOAK else 0.96  # of few captures one is two percent
SEEDS = range(60_000, 60_040 if IS_SOAK else 60_002)


def findings_at(made: Built, path: Path, host: int = 5) -> list[tuple[float, str]]:
    """Return how sure which causes are, of the lines of one PLC end, the surest first."""
    path.write_bytes(made.file(80 if made.what == "cut" else 0))
    verdicts = verdicts_of(path, made.plc, (made.receiver,) if made.receiver else ())
    best: dict[str, float] = {}
    for one in verdicts:
        if _is_of(one, host):
            for finding in one["findings"]:
                best[finding["cause"]] = max(best.get(finding["cause"], 0.0), finding["confidence"])
    return sorted(((sure, cause) for cause, sure in best.items()), reverse=True)


def _is_of(verdict: dict[str, Any], host: int) -> bool:
    return f"10.0.0.{host}:" in "{plc} {partner}".format(**verdict["conversation"])


def shares(name: str, cases: Iterable[Built], path: Path) -> tuple[float, float]:
    """Return how often the right cause was first, and among three; print that of a soak."""
    total = first = three = 0
    said: Counter[float] = Counter()
    right: Counter[float] = Counter()
    wrong: Counter[tuple[str, Sequence[str]]] = Counter()
    for made in cases:
        found = findings_at(made, path)
        causes = tuple([cause for _, cause in found])
        total += 1
        first += causes[:1] == (made.cause,)
        three += made.cause in causes[:3]
        if causes[:1] != (made.cause,):
            wrong[made.cause, causes[:3]] += 1
        for sure, cause in found[:1]:
            said[round(sure, 1)] += 1
            right[round(sure, 1)] += cause == made.cause
    if IS_SOAK:
        print(
            f"\n{name}: {total} captures, first {first / total:.2%}, among three {three / total:.2%}", wrong
        )
        print(
            "  said, right:", {sure: (said[sure], f"{right[sure] / said[sure]:.1%}") for sure in sorted(said)}
        )
    return first / total, three / total


def false_alarms(name: str, cases: Iterable[Built], path: Path) -> float:
    found = [(made.what, findings_at(made, path)) for made in cases]
    told = Counter((what, one[0][1]) for what, one in found if one)
    if IS_SOAK:
        print(f"\n{name}: {len(found)} healthy captures, {sum(told.values())} false alarms", told)
    return sum(told.values()) / len(found)


def test_the_right_cause_is_first_and_among_three(tmp_path: Path) -> None:
    first, three = shares("one fault", faults(SEEDS), tmp_path / "c.pcapng")
    assert first >= 0.95 and three >= OF_THREE


def test_healthy_lines_are_healthy(tmp_path: Path) -> None:
    assert false_alarms("healthy", healthy(SEEDS), tmp_path / "c.pcapng") <= 0.01


def test_noise_hides_no_cause_and_makes_none(tmp_path: Path) -> None:
    seeds = SEEDS[:: 1 if IS_SOAK else 2]
    noisy = (in_noise(made, n) for n, made in enumerate(faults(seeds)) if made.cause != "datagram-size")
    first, three = shares("noise", noisy, tmp_path / "c.pcapng")
    assert first >= 0.95 and three >= OF_THREE - 0.01
    quiet = (in_noise(made, n) for n, made in enumerate(healthy(seeds)) if made.what != "healthy_udp")
    assert false_alarms("healthy in noise", quiet, tmp_path / "c.pcapng") <= 0.01


def test_a_capture_that_begins_in_mid_conversation_is_judged(tmp_path: Path) -> None:
    late = (in_the_middle(made) for made in faults(SEEDS) if made.cause in LATE)
    first, three = shares("from the middle", late, tmp_path / "c.pcapng")
    assert first >= 0.9 and three >= 0.95


def test_two_faults_of_two_lines_are_both_named(tmp_path: Path) -> None:
    total = first = 0
    for seed in range(SEEDS.start, SEEDS.start + len(SEEDS) * 10):
        both, one, other = two_faults(seed)
        if one.receiver is not None or other.receiver is not None:
            continue  # they would expect something of both lines
        for made, host in ((one, 5), (other, 25)):
            total += 1
            found = findings_at(both, tmp_path / "c.pcapng", host)
            first += [cause for _, cause in found][:1] == [made.cause]
    if IS_SOAK:
        print(f"\ntwo faults: {total} lines, first {first / total:.2%}")
    assert first >= 0.9 * total
