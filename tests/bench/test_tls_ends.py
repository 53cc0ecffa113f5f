"""How a TLS connection ends in good order: each close_notify is answered (RFC 8446 6.1), in both roles.

The partner is Python's own ssl on a thread, so that its unwrap() may wait while scans pass, or openssl.
"""

from __future__ import annotations

import socket
import ssl
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.bench.bench_lines import do
from tests.bench.test_tls_blocks import CLIENT, SERVER, Desk, desk_of, openssl, s_client, s_server, shows
from tests.certificates import NEEDS_OPENSSL

pytestmark = NEEDS_OPENSSL
VERSIONS = {"1.2": ssl.TLSVersion.TLSv1_2, "1.3": ssl.TLSVersion.TLSv1_3}
ENDS = ("set X CONT=0", "set X COM_RST=1", "plc stop")
STRICT = False  # a FIN alone would be an SSLEOFError
LONG = 20  # s; nobody waits so long


class Partner:
    """Does something with a TLS connection on a thread of its own; keeps what it found, or the error."""

    def __init__(self, folder: Path, version: str, act: Callable[[ssl.SSLSocket], object]) -> None:
        self._folder, self._version, self._act = folder / "certificates", VERSIONS[version], act
        self.found: object = None
        self.up = threading.Event()

    def calls(self, port: int) -> None:
        raw = socket.create_connection(("127.0.0.1", port), LONG)
        self._begin(
            lambda: self._context(ssl.PROTOCOL_TLS_CLIENT).wrap_socket(raw, suppress_ragged_eofs=STRICT)
        )

    def waits(self) -> int:
        listener = socket.create_server(("127.0.0.1", 0))
        listener.settimeout(LONG)

        def come() -> ssl.SSLSocket:
            with listener:
                raw = listener.accept()[0]
            raw.settimeout(LONG)
            return self._context(ssl.PROTOCOL_TLS_SERVER).wrap_socket(
                raw, server_side=True, suppress_ragged_eofs=STRICT
            )

        self._begin(come)
        return int(listener.getsockname()[1])

    def _context(self, side: int) -> ssl.SSLContext:
        context = ssl.SSLContext(side)
        context.check_hostname = False
        context.verify_mode = ssl.CERT_REQUIRED
        context.minimum_version = context.maximum_version = self._version
        context.load_verify_locations(self._folder / "ca.pem")
        context.load_cert_chain(self._folder / "partner.pem", self._folder / "partner.key")
        return context

    def _begin(self, meet: Callable[[], ssl.SSLSocket]) -> None:
        def live() -> None:
            try:
                with meet() as end:
                    self.up.set()
                    self.found = self._act(end)
            except OSError as problem:
                self.found = problem

        self._thread = threading.Thread(target=live, daemon=True)
        self._thread.start()

    def is_done(self) -> bool:
        return not self._thread.is_alive()


def speaks_and_unwraps(end: ssl.SSLSocket) -> object:
    end.sendall(b"abcd")
    end.unwrap().close()
    return "in good order"


def hears_the_end_and_unwraps(end: ssl.SSLSocket) -> object:
    heard = end.recv(1)
    end.unwrap().close()
    return "in good order" if heard == b"" else heard


def meet(desk: Desk, partner: Partner, calls: bool) -> None:
    if calls:
        partner.calls(desk.port())
    desk.run_until(partner.up.is_set)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("calls", [True, False], ids=["we are server", "we are client"])
def test_a_partner_who_unwraps_is_answered(secure_bench: Path, version: str, calls: bool) -> None:
    partner = Partner(secure_bench, version, speaks_and_unwraps)
    with desk_of(secure_bench, SERVER if calls else CLIENT.format(port=partner.waits())) as desk:
        meet(desk, partner, calls)
        desk.run_until(partner.is_done)
        assert partner.found == "in good order"
        assert desk.bench.runtime.data("rx") == b"abcd"


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("calls", [True, False], ids=["we are server", "we are client"])
def test_a_partner_who_unwraps_while_nobody_receives_is_answered(
    secure_bench: Path, version: str, calls: bool
) -> None:
    partner = Partner(secure_bench, version, speaks_and_unwraps)
    with desk_of(secure_bench, SERVER if calls else CLIENT.format(port=partner.waits())) as desk:
        do(desk.bench, "set X EN_R=0")
        meet(desk, partner, calls)
        desk.run_until(partner.is_done)
        assert partner.found == "in good order"


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("calls", [True, False], ids=["we are server", "we are client"])
@pytest.mark.parametrize("how", ENDS)
def test_our_end_is_a_close_notify(secure_bench: Path, version: str, calls: bool, how: str) -> None:
    partner = Partner(secure_bench, version, hears_the_end_and_unwraps)
    with desk_of(secure_bench, SERVER if calls else CLIENT.format(port=partner.waits())) as desk:
        meet(desk, partner, calls)
        desk.run_until(lambda: desk.status() == "7006")
        do(desk.bench, how)
        desk.run_until(partner.is_done)
        assert partner.found == "in good order"


@pytest.mark.parametrize("version", ["-tls1_2", "-tls1_3"])
@pytest.mark.parametrize("how", ENDS)
def test_s_client_ends_without_an_error(secure_bench: Path, version: str, how: str) -> None:
    with desk_of(secure_bench, SERVER) as desk:
        words = s_client(desk.port(), f"{shows('partner')} -verify_return_error {version}")
        with openssl(secure_bench, words) as client:
            desk.run_until(lambda: desk.status() == "7006")
            do(desk.bench, how)
            desk.run_until(lambda: client.poll() is not None)
            assert client.returncode == 0
            assert client.stdout is not None
            assert b"rror" not in client.stdout.read()


@pytest.mark.parametrize("version", ["-tls1_2", "-tls1_3"])
@pytest.mark.parametrize("how", ENDS)
def test_s_server_ends_without_an_error(secure_bench: Path, version: str, how: str) -> None:
    wants = f"{shows('partner')} -Verify 1 -verify_return_error -naccept 1 {version}"
    with (
        s_server(secure_bench, wants) as (port, server),
        desk_of(secure_bench, CLIENT.format(port=port)) as desk,
    ):
        desk.run_until(lambda: desk.status() == "7006")
        do(desk.bench, how)
        desk.run_until(lambda: server.poll() is not None)
        assert server.stdout is not None
        said = server.stdout.read()
        assert server.returncode == 0, said
        assert b"rror" not in said.replace(b"-verify_return_error", b"")
