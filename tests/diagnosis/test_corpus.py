"""The doctor on public captures, and on a few of them with a fault added; `make doctor-corpus` takes all."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.diagnosis import corpus
from tests.diagnosis.mutations import MUTATIONS, Mutation, Subject

needs_given = pytest.mark.skipif(not corpus.GIVEN.is_dir(), reason=corpus.ABSENT)


@pytest.fixture(scope="module")
def chosen() -> list[tuple[corpus.Given, Subject]]:
    return list(corpus.subjects())[:39:13]  # of three families of devices, odd and even


@needs_given
@pytest.mark.parametrize("is_one_run", [False, True])
def test_public_captures_have_no_false_alarm(is_one_run: bool) -> None:
    some = [one for one in corpus.given_captures() if (corpus.ONE_RUN in one.path.name) == is_one_run]
    outcomes = [corpus.outcome_of_given(one) for one in some]
    assert len(outcomes) > 70 and [one for one in outcomes if one.missed] == []
    false = [one for one in outcomes if one.false]
    assert len(false) <= 1, false


@needs_given
@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda one: one.name)
def test_what_was_added_is_told_and_nothing_else(
    mutation: Mutation, chosen: list[tuple[corpus.Given, Subject]], tmp_path: Path
) -> None:
    outcomes = [corpus.outcome_of_mutation(*one, mutation, tmp_path) for one in chosen]
    assert [one for one in outcomes if one.false or one.missed] == []


def test_the_list_of_our_own_projects_names_none_that_is_not_there() -> None:
    names = {name for causes in corpus.expected().values() for some in causes.values() for name in some}
    assert names - {path.stem for path in corpus.own_projects()} == set()
