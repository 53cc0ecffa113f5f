"""The Baosky questionnaire: switches, their defaults, and the rules that they give."""

from __future__ import annotations

import pytest

from tests.dialects.foreign import NOT_BAOSKYS
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.rules import NotConnectedRule, StatusRules, VendorRules
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.baosky.rules import BAOSKY
from trcvtui.dialects.dialect import defaults, format_value, read_switches
from trcvtui.net.connection.config import ConnectionPolicy


def rules(**raw: object) -> VendorRules:
    values, problems = read_switches(BAOSKY, raw, "options")
    assert problems == []
    return BAOSKY.answer(values)


def test_the_registry_knows_baosky_by_its_name() -> None:
    assert DIALECTS["baosky"] is BAOSKY


def test_a_t3_carries_8_connections_and_a_t4_which_is_the_default_32() -> None:
    assert BAOSKY.models == {"T3": 8, "T4": 32}
    assert BAOSKY.default_model == "T4"


def test_the_switches_have_the_names_and_defaults_of_the_design() -> None:
    assert {switch.name: format_value(switch, switch.default) for switch in BAOSKY.switches} == {
        "retry": "T#1s",
        "attempt_limit": "T#5s",
        "not_connected": "pulse",
        "short_frame": "both",
        "reset_is": "80AA",
        "dead_link": "silent",
        "adhoc": "at_once",
        "com_rst_autoclear": "true",
        "max_len": "65535",
        "large_datagram": "error",
        "buffers": "64",
        "queue": "64",
        "lock_across_tasks": "false",
        "user_timeout": "true",
        "strict_local_address": "false",
        "second_client": "reject",
        "check_remote_ip": "true",
        "check_remote_port": "false",
        "backlog": "128",
        "internal_fault": "8FFF",
        "small_buffers": "false",
    }


def test_without_switches_the_rules_are_the_decisions_of_the_design() -> None:
    answered = BAOSKY.answer({})
    of_the_manual = StatusRules(silent_dead_link=True)
    assert answered == VendorRules(status=answered.status, course=of_the_manual, adhoc_at_once=True)
    assert answered.policy == ConnectionPolicy()


def test_every_switch_gives_the_same_rules_at_its_default_as_when_it_is_left_out() -> None:
    assert BAOSKY.answer(defaults(BAOSKY)) == BAOSKY.answer({})


def test_a_condition_gets_the_word_of_the_manual() -> None:
    status = BAOSKY.answer({}).status
    assert status[Condition.RECEIVING] == 0x7006
    assert status[Condition.PARTNER_CLOSED] == 0x80C5
    assert set(status) == set(Condition) - NOT_BAOSKYS


@pytest.mark.parametrize(
    ("name", "value", "field", "expected"),
    [
        ("not_connected", "hold", "not_connected", NotConnectedRule.HOLD),
        ("not_connected", "never", "not_connected", NotConnectedRule.NEVER),
        ("short_frame", "80C5", "short_frame_shown", False),
        ("reset_is", "80C5", "reset_counts_as_close", True),
        ("com_rst_autoclear", False, "com_rst_autoclear", False),
        ("adhoc", "latched", "adhoc_at_once", False),
        ("dead_link", "80A0", "course", StatusRules()),
        ("max_len", 65536, "max_len", 65536),
        ("buffers", 2, "buffers", 2),
        ("queue", 0, "queue", 0),
    ],
)
def test_a_switch_reaches_its_rule(name: str, value: object, field: str, expected: object) -> None:
    assert getattr(rules(**{name: value}), field) == expected


@pytest.mark.parametrize(
    ("name", "value", "field", "expected"),
    [
        ("retry", "T#100ms", "retry_ns", 100_000_000),
        ("attempt_limit", "T#2s500ms", "attempt_limit_ns", 2_500_000_000),
        ("strict_local_address", True, "strict_local_address", True),
        ("second_client", "replace", "second_client", "replace"),
        ("check_remote_ip", False, "check_remote_ip", False),
        ("check_remote_port", True, "check_remote_port", True),
        ("backlog", 2, "backlog", 2),
        ("small_buffers", True, "small_buffers", True),
    ],
)
def test_a_switch_reaches_the_connection_policy(
    name: str, value: object, field: str, expected: object
) -> None:
    assert getattr(rules(**{name: value}).policy, field) == expected
