"""A secure connection says so on the screen, and one with unchecked certificates says it everywhere."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.certificates import NEEDS_OPENSSL
from tests.tui.looking import BOTH
from tests.tui.stage import Stage, on_stage
from trcvtui.scenario.scenario import load_scenario

pytestmark = NEEDS_OPENSSL


@asynccontextmanager
async def opened(file: Path, size: tuple[int, int]) -> AsyncIterator[Stage]:
    async with on_stage(Stage, load_scenario(file).project, size) as shown:
        await shown.do()
        yield shown


@pytest.fixture
def client(secure_bench: Path) -> Path:
    return secure_bench / "tls-client.toml"


@BOTH
async def test_a_connection_that_checks_no_certificate_says_so_in_every_pane(
    client: Path, size: tuple[int, int]
) -> None:
    async with opened(client, size) as shown:
        await shown.do("set X_unsafe CONT=1", scans=30)
        await shown.select("X_unsafe")
        assert "TLS NOT CHECKED active" in shown.words, "the block"
        await shown.press("1", "up", "down")  # until it is in view
        assert "TLS!" in shown.line("▸ X_unsafe "), "the list"
        await shown.press("3")
        assert 'The certificate of the partner is not checked: verify = "none,' in shown.words, "STATUS"
        await shown.press("C")
        assert "TCP, TLS NOT CHECKED, active to" in shown.words
        assert '! the certificate of the partner is not checked: verify = "none,' in shown.words
        assert "NOT CHECKED: any certificate is accepted" in shown.words


@BOTH
async def test_a_checked_connection_says_tls_and_which_files_its_references_mean(
    client: Path, size: tuple[int, int]
) -> None:
    async with opened(client, size) as shown:
        await shown.do("set X_good CONT=1", scans=30)
        await shown.select("X_good")
        assert "C_good TLS active, connected" in shown.words and " TLS" in shown.line("▸ X_good ")
        await shown.press("3")
        assert "not checked" not in shown.words
        await shown.press("C")
        assert "trusts certificates/ca.pem" in shown.words and "shows certificates/plc.pem" in shown.words
