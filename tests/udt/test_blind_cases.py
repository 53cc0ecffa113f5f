"""Blind cases: hidden types, profiles and causes. The lab names the cause, and is never wrongly sure."""

from __future__ import annotations

import os

import pytest

from tests.udt.blind_cases import CAUSES, FILLS, make, measure
from trcvtui.udt.compare.fit import rank

IS_SOAK = "TRCVTUI_SOAK" in os.environ  # make soak: minutes
FIRST_SEED = 50_000  # the points were chosen by the seeds below 2000
# Few, with 50_017: its words are exchanged, and best is said of another reading if none beside it is a doubt.
BLIND = range(FIRST_SEED, FIRST_SEED + 400) if IS_SOAK else range(50_012, 50_020)
HARD = 400 if IS_SOAK else 8
# Of how many the right reading shares the first rank, and of how many it stands first there. Exchanged words
# in one byte order and exchanged bytes in the other are often the same bytes: chance puts one of them first.
FIRST_RANK = {"word-swap": 0.9}
FIRST_OF_ALL = {"word-swap": 0.73, "byte-swap": 0.78, "short": 0.87}
OF_FEW = 0.15  # how much less of few cases

pytestmark = pytest.mark.timeout(3600 if IS_SOAK else 120)


@pytest.mark.slow
@pytest.mark.parametrize("cause", CAUSES)
def test_the_cause_of_a_blind_case_is_first_and_none_is_called_best_wrongly(cause: str) -> None:
    found = measure(BLIND, cause)
    print(f"\n{cause}: {found}")
    assert found.seeds == (), "best was said of another reading"
    less = 0.0 if IS_SOAK else OF_FEW
    assert found.among >= (FIRST_RANK.get(cause, 0.93) - less) * found.cases, found.missed
    assert found.first >= (FIRST_OF_ALL.get(cause, 0.93) - less) * found.cases, found.missed


@pytest.mark.slow
@pytest.mark.parametrize("cause", CAUSES)
def test_readings_of_one_rank_find_the_same_and_ranks_count_all_before_them(cause: str) -> None:
    for seed in range(FIRST_SEED, FIRST_SEED + 6):
        case = make(seed, cause)
        if case is None:
            continue
        fits = rank(case.type, case.messages, "T")
        ranks = [found.rank for found in fits]
        assert ranks == [ranks.index(rank) + 1 for rank in ranks]
        for found in fits:
            others = [one for one in fits if one.rank == found.rank and one is not found]
            assert sorted(found.same) == sorted(one.name for one in others)
            assert not (found.fits_best and any(one.cause.kind != found.cause.kind for one in others))


@pytest.mark.slow
@pytest.mark.parametrize("fill", FILLS)
def test_numbers_that_are_hard_never_make_a_wrong_reading_best(fill: str) -> None:
    found = measure(range(FIRST_SEED, FIRST_SEED + HARD), "none", fill)
    print(f"\n{fill}: {found}")
    assert found.seeds == (), "best was said of another reading"
