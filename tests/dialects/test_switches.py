"""Switch values out of TOML and out of `--set`, and the mistakes that can be made in them."""

from __future__ import annotations

import pytest

from tests import golden
from trcvtui.dialects.baosky.rules import BAOSKY
from trcvtui.dialects.dialect import defaults, describe_expected, format_value, read_switches


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


READ = (
    *[("check_remote_port", given, True) for given in (True, "true", "TRUE", " True ", 1, "1")],
    *[("check_remote_ip", given, False) for given in (False, "false", "FALSE", 0, "0")],
    *[
        ("retry", given, ns)
        for given, ns in (("T#100ms", 100_000_000), ("t#0s", 0), ("TIME#1m30s", 90 * 10**9))
    ],
    *[("buffers", given, 12) for given in (12, "12", " 12 ")],
    *[("max_len", given, "65536") for given in (65536, "65536")],
    ("reset_is", "80c5", "80C5"),
)


def test_a_value_may_be_written_in_every_usual_way() -> None:
    assert [(name, given) for name, given, value in READ if read(**{name: given}) != value] == []


WRONG = (
    *[("retry", given) for given in ("soon", "T#-1s", 5)],
    *[("not_connected", given) for given in ("blink", True)],
    ("max_len", 70000),
    *[("check_remote_ip", given) for given in ("perhaps", 2, [1])],
    *[("buffers", given) for given in (-1, True, 1.5, "9" * 5000)],
    ("queue", "many"),
)


def test_a_wrong_value_is_one_line_that_names_its_place() -> None:
    said = [(f"{name} = {given!r:.20}", mistakes({name: given})) for name, given in WRONG]
    assert all(len(lines) == 1 and len(lines[0]) < 200 for _, lines in said)
    golden.agree("mistakes", "switches", said)


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
    assert describe_expected(known)
