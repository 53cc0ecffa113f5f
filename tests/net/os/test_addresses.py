"""The addresses of this machine: how they are asked for, and what is known when the system cannot answer."""

from __future__ import annotations

import socket
import subprocess
import sys

import pytest

from tests.net.os.test_os_kernel import no_descriptor_left
from trcvtui.net.connection.config import ConnectConfig, ConnectionPolicy
from trcvtui.net.connection.resources import ConnectionIds, ScanBudget
from trcvtui.net.connection.set_up import SetUp, SetUpStage, find_address_error
from trcvtui.net.kernel import LocalAddress
from trcvtui.net.os import network as os_addresses
from trcvtui.net.os.kernel import OsKernel
from trcvtui.net.os.network import interface_addresses
from trcvtui.net.results import Endpoint, Fault, broadcast_address


def test_asking_for_the_addresses_starts_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a process was started in the middle of a scan")

    os_addresses._c_library.cache_clear()
    monkeypatch.setattr(subprocess, "Popen", refuse)
    assert "127.0.0.1" in [own.address for own in interface_addresses() or ()]


def test_a_system_without_such_a_list_leaves_the_address_to_bind(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a name was asked for in the middle of a scan")

    for lookup in ("gethostbyname", "gethostbyname_ex", "getaddrinfo", "gethostname"):
        monkeypatch.setattr(socket, lookup, refuse)
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(os_addresses, "_c_library", lambda: None)
    kernel = OsKernel()
    assert kernel.local_addresses() == ()
    set_up = SetUp(
        ConnectConfig("C1", local=Endpoint("192.0.2.7", 0)),
        kernel,
        ConnectionPolicy(),
        lambda name: None,
        ConnectionIds(),
        lambda *note: None,
        ScanBudget(),
    )
    assert set_up.create_socket() is None
    failed = set_up.bind_and_start(0)
    assert failed is not None
    assert (failed.stage, failed.fault) == (SetUpStage.ADDRESS, Fault("bind", "EADDRNOTAVAIL"))
    kernel.close_all()


def test_without_a_descriptor_the_last_list_of_addresses_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = OsKernel()
    own = (*(interface_addresses() or ()), LocalAddress("192.0.2.7", "eth7"))
    with monkeypatch.context() as cabinet:
        cabinet.setattr("trcvtui.net.os.kernel.interface_addresses", lambda: own)
        assert kernel.local_addresses() == own
    with no_descriptor_left():
        assert interface_addresses() is None
        assert kernel.local_addresses() == own


def test_where_no_list_was_ever_got_bind_decides_about_the_address() -> None:
    kernel = OsKernel()
    with no_descriptor_left():
        nobody_knows = kernel.local_addresses()
    assert nobody_knows == ()
    assert find_address_error("192.0.2.7", nobody_knows, strict=False) == ""
    assert "multicast" in find_address_error("224.0.0.1", nobody_knows, strict=False)
    assert "no address" in find_address_error("192.0.2.7", kernel.local_addresses(), strict=False)


@pytest.mark.parametrize(
    ("address", "mask", "everybody"),
    [
        ("127.0.0.1", "255.0.0.0", "127.255.255.255"),
        ("10.1.2.3", "255.255.252.0", "10.1.3.255"),
        ("192.0.2.7", "255.255.255.0", "192.0.2.255"),
        ("192.0.2.6", "255.255.255.252", "192.0.2.7"),
        ("192.0.2.6", "255.255.255.254", ""),
        ("192.0.2.6", "255.255.255.255", ""),
        ("192.0.2.6", "", ""),
    ],
)
def test_the_last_address_of_a_network_is_its_broadcast_address(
    address: str, mask: str, everybody: str
) -> None:
    assert broadcast_address(address, mask) == everybody


def test_the_broadcast_address_of_an_interface_is_no_local_address_but_an_own_one_is() -> None:
    own = (
        LocalAddress("10.0.0.5", "eth0", broadcast="10.0.0.255"),
        LocalAddress("10.0.1.255", "eth1", broadcast="10.0.255.255"),
        LocalAddress("10.0.1.9", "eth2", broadcast="10.0.1.255"),
    )
    assert "broadcast address of eth0" in find_address_error("10.0.0.255", own, strict=False)
    assert find_address_error("10.0.1.255", own, strict=False) == ""
