"""What a finding says mends it, done to who receives: it is gone, and no other comes in its place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.diagnosis.doctor_cases import FAULTS, built
from tests.diagnosis.test_doctor import found_in
from trcvtui.diagnosis.receiver import Receiver
from trcvtui.udt.layout.layout import lay_out
from trcvtui.udt.layout.rules import LayoutChoice

# Causes whose remedy is a parameter of the bench. Of others the partner, the cable, the program is mended;
# of `shifted` a pulse of COM_RST, of `header` a declaration.
BY_A_PARAMETER = (
    "frame-short", "frame-long", "adhoc-missing", "adhoc-splits", "datagram-size", "byte-order", "padding",
)  # fmt: skip


def with_parameter(receiver: Receiver, path: str) -> Receiver:
    """Return a receiver in which a path of `--set` has its value."""
    place, _, value = path.partition("=")
    kind, name, key = place.split(".")
    if kind == "instance":
        assert name == receiver.instance
        if key == "LEN":
            return receiver._replace(need=int(value))
        assert key == "ADHOC", path
        return receiver._replace(adhoc=value == "true")
    assert (kind, name) == ("data", receiver.data)
    rules = receiver.rules
    assert rules is not None and receiver.type is not None
    given: dict[str, str] = {key: value}
    rules = LayoutChoice(**given).rules(rules)  # type: ignore[arg-type]
    if key == "layout":
        rules = replace(rules, byte_order=receiver.rules.byte_order if receiver.rules else "little")
    return receiver._replace(rules=rules, need=lay_out(receiver.type, rules, receiver.type_name).size)


@pytest.mark.parametrize("cause", BY_A_PARAMETER)
def test_the_remedy_of_a_finding_takes_its_evidence_away(cause: str, tmp_path: Path) -> None:
    make, kinds = next((make, kinds) for each, make, kinds in FAULTS if each == cause)
    done = 0
    for seed in range(2001, 2009):
        made = built(cause, make, kinds[0], seed)
        first = next(iter(found_in(made, tmp_path)), None)
        if first is None or first["cause"] != cause:  # the figures of docs/doctor.md say how often
            continue
        paths = [mend["set"] for mend in first["mend"] if mend["set"]]
        for path in paths:
            assert made.receiver is not None
            made.receiver = with_parameter(made.receiver, path)
        if paths:
            done += 1
            assert found_in(made, tmp_path) == [], (seed, paths)
    assert done >= 5
