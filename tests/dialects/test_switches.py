"""Switch values out of TOML and out of `--set`, and the mistakes that can be made in them."""

from __future__ import annotations

import pytest

from trcvtui.dialects.baosky.rules import BAOSKY
from trcvtui.dialects.dialect import defaults, expected_of, format_value, read_switches


def read(**raw: object) -> object:
    values, problems = read_switches(BAOSKY, raw, "bench.toml: options")
    assert problems == []
    [name] = raw
    return values[name]


def mistakes(raw: dict[str, object]) -> list[str]:
    values, problems = read_switches(BAOSKY, raw, "bench.toml: options")
    assert values == defaults(BAOSKY)
    return [str(problem) for problem in problems]


def test_what_is_not_given_has_its_default() -> None:
    values, problems = read_switches(BAOSKY, {}, "options")
    assert (values, problems) == (defaults(BAOSKY), [])


@pytest.mark.parametrize("given", [True, "true", "TRUE", " True ", 1, "1"])
def test_a_bool_may_be_written_in_every_usual_way(given: object) -> None:
    assert read(check_remote_port=given) is True


@pytest.mark.parametrize("given", [False, "false", "FALSE", 0, "0"])
def test_a_false_bool_may_be_written_in_every_usual_way(given: object) -> None:
    assert read(check_remote_ip=given) is False


@pytest.mark.parametrize(
    ("given", "ns"), [("T#100ms", 100_000_000), ("t#0s", 0), ("TIME#1m30s", 90_000_000_000)]
)
def test_a_duration_is_an_iec_literal_and_becomes_nanoseconds(given: str, ns: int) -> None:
    assert read(retry=given) == ns


@pytest.mark.parametrize("given", [12, "12", " 12 "])
def test_a_count_may_be_a_number_or_its_digits(given: object) -> None:
    assert read(buffers=given) == 12


@pytest.mark.parametrize("given", [65536, "65536"])
def test_a_choice_between_numbers_may_be_a_number(given: object) -> None:
    assert read(max_len=given) == "65536"


def test_a_choice_does_not_care_about_upper_and_lower_case() -> None:
    assert read(reset_is="80c5") == "80C5"


@pytest.mark.parametrize(
    ("name", "given", "line"),
    [
        ("retry", "soon", "found 'soon', expected a duration such as T#1s500ms, not negative"),
        ("retry", "T#-1s", "found 'T#-1s', expected a duration such as T#1s500ms, not negative"),
        ("retry", 5, "found 5, expected a duration such as T#1s500ms, not negative"),
        ("not_connected", "blink", "found 'blink', expected pulse or hold or never"),
        ("not_connected", True, "found true, expected pulse or hold or never"),
        ("max_len", 70000, "found 70000, expected 65535 or 65536"),
        ("check_remote_ip", "perhaps", "found 'perhaps', expected true or false"),
        ("check_remote_ip", 2, "found 2, expected true or false"),
        ("check_remote_ip", [1], "found [1], expected true or false"),
        ("buffers", -1, "found -1, expected a whole number from 0 to 1000000"),
        ("buffers", True, "found true, expected a whole number from 0 to 1000000"),
        ("buffers", 1.5, "found 1.5, expected a whole number from 0 to 1000000"),
        ("buffers", "9" * 5000, "expected a whole number from 0 to 1000000"),
        ("queue", "many", "found 'many', expected a whole number from 0 to 1000000"),
    ],
)
def test_a_wrong_value_is_one_line_that_says_what_was_expected(name: str, given: object, line: str) -> None:
    [said] = mistakes({name: given})
    assert said.startswith(f"bench.toml: options.{name}: found ")
    assert said.endswith(line)
    assert len(said) < 200


def test_an_unknown_switch_is_answered_with_the_names_that_exist() -> None:
    [said] = mistakes({"retri": "T#1s"})
    assert said.startswith(
        "bench.toml: options.retri: found an unknown switch, expected a switch of baosky: retry,"
    )
    assert said.endswith("small_buffers")


def test_all_mistakes_of_a_table_are_reported_and_the_good_values_are_kept() -> None:
    values, problems = read_switches(BAOSKY, {"a": 1, "queue": "x", "buffers": 3}, "options")
    assert [problem.where for problem in problems] == ["options.a", "options.queue"]
    assert values["buffers"] == 3


@pytest.mark.parametrize("switch", BAOSKY.switches, ids=lambda switch: switch.name)
def test_a_default_is_written_in_a_form_that_reads_back(switch: object) -> None:
    [known] = [s for s in BAOSKY.switches if s is switch]
    assert read(**{known.name: format_value(known, known.default)}) == known.default
    assert expected_of(known)
