"""A partner by name: what the network answers is asked for at each attempt, and an attempt's end ends it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenario.scenarios import failures, play

PROJECT = """
dialect = "s7-1500"
{sim}
[[data]]
name = "tx"
type = "ARRAY[0..3] OF BYTE"
[[connect]]
name = "C1"
type = "TCON_QDN"
ActiveEstablished = true
RemoteQDN = "{name}"
RemotePort = "@P1"
[[instance]]
name = "X"
block = "TSEND_C"
connect = "C1"
data = "tx"
[[peer]]
name = "P1"
[scenario]
name = "names"
steps = '''
set X CONT=1
{steps}
'''
"""
FAILS = """
fault resolve on C1
wait X STATUS=80D3
fault resolve EAI_AGAIN on C1
wait X STATUS=80D2
wait X STATUS=7004
expect X trace 7001 7002+ 80D3! 7001 7002+ 80D2! 7001 7002+ 7004
"""
TABLE = '[sim]\nnames = { "plc2.line.local." = "127.0.0.1" }'


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kernel", "sim", "name", "steps"),
    [
        ("sim", TABLE, "PLC2.line.local.", "wait X STATUS=7004"),
        ("sim", TABLE, "plc3.line.local.", "wait X STATUS=80D3\nexpect X trace 7001 7002+ 80D3!"),
        ("sim", "", "plc9.line.invalid.", "wait X STATUS=80D3\nexpect X trace 7001 7002+ 80D3!"),
        ("live", "", "plc9.line.invalid.", "wait X STATUS=80D3\nexpect X trace 7001 7002+ 80D3!"),
        ("live", "", "localhost.", "wait X STATUS=7004\nexpect X trace 7001 7002+ 7004"),
        ("sim", TABLE, "plc2.line.local.", FAILS),
        ("live", "", "localhost.", FAILS),
        ("live", "", "localhost.", "run 2\nset X CONT=0\nwait X STATUS=7000"),
    ],
)
def test_a_partner_by_name(tmp_path: Path, kernel: str, sim: str, name: str, steps: str) -> None:
    file = tmp_path / "names.toml"
    file.write_text(PROJECT.format(sim=sim, name=name, steps=steps))
    played = play(file, kernel)
    assert played.verdict.has_passed, failures(played.verdict)
