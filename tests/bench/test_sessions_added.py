"""`add connect` of ISO-on-TCP and of TLS to a running bench of plain TCP: as good as one of the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bench.iso_desk import Desk
from tests.certificates import Certificates
from trcvtui.net.faults import FaultyKernel
from trcvtui.net.layers.layer_kernel import LayerKernel

PLAIN = """
dialect = "s7-1500"
{certificates}
[[data]]
name = "rx"
type = "ARRAY[0..7] OF BYTE"
[[connect]]
name = "C1"
type = "TCON_IP_v4"
LocalPort = 2000
ListenPort = 0
[[instance]]
name = "R1"
block = "TRCV_C"
connect = "C1"
data = "rx"
[[peer]]
name = "P1"
remote = "@C1"
"""
CERTIFICATES = """
[[certificate]]
number = 1
file = "{ca}"
[[certificate]]
number = 2
file = "{plc}"
key = "{key}"
"""
KERNELS = pytest.mark.parametrize("kernel", ["sim", "live"])


def plain_desk(folder: Path, kernel: str, certificates: str = "") -> Desk:
    desk = Desk(PLAIN.format(certificates=certificates), folder, kernel)
    desk.say("set R1 CONT=1 EN_R=1", "run 3", "peer P1 connect")
    desk.until_status("R1", "7006")
    assert isinstance(desk.bench.runtime._kernel, FaultyKernel)
    return desk


def receives(desk: Desk, instance: str, peer: str) -> None:
    desk.say(f"peer {peer} send hex 01 02 03 04 05 06 07 08")
    desk.until_done(instance)


@KERNELS
def test_iso_on_tcp_is_added_and_plain_tcp_goes_on(tmp_path: Path, kernel: str) -> None:
    desk = plain_desk(tmp_path, kernel)
    desk.say("add connect C2 type=TCON_IP_RFC LocalTSelector=E0.02 IsoPort=0")
    desk.say("add instance R2 block=TRCV_C connect=C2 data=rx CONT=1 EN_R=1")
    desk.say("add peer P2 remote=@C2 iso=true local_tsap=E0.01 remote_tsap=E0.02", "run 4", "peer P2 connect")
    desk.until_status("R2", "7006")
    assert isinstance(desk.bench.runtime._kernel, LayerKernel)
    receives(desk, "R2", "P2")
    receives(desk, "R1", "P1")  # over the very connection of before
    assert desk.bench.peers["P1"].state == "connected"
    desk.close()


@KERNELS
def test_a_second_one_shares_the_port_of_the_first(tmp_path: Path, kernel: str) -> None:
    desk = plain_desk(tmp_path, kernel)
    for n in (2, 3):
        desk.say(f"add connect C{n} type=TCON_IP_RFC LocalTSelector=E0.0{n} IsoPort=0")
        desk.say(f"add instance R{n} block=TRCV_C connect=C{n} data=rx CONT=1 EN_R=1", "run 4")
    assert desk.port("C2") == desk.port("C3")
    desk.say("add peer P3 remote=@C3 iso=true local_tsap=E0.01 remote_tsap=E0.03", "peer P3 connect")
    desk.until_status("R3", "7006")
    receives(desk, "R3", "P3")
    desk.close()


@KERNELS
def test_tls_is_added_too(tmp_path: Path, kernel: str, certificates: Certificates) -> None:
    pem = CERTIFICATES.format(
        ca=certificates.pem("ca"), plc=certificates.pem("plc"), key=certificates.key("plc")
    )
    desk = plain_desk(tmp_path, kernel, pem)
    desk.say(
        "add connect C2 type=TCON_IP_V4_SEC ActivateSecureConn=true TLSServerCertRef=2 LocalPort=2001"
        " ListenPort=0"
    )
    desk.say("add instance R2 block=TRCV_C connect=C2 data=rx CONT=1 EN_R=1")
    desk.say("add peer P2 remote=@C2 tls=true authority=1", "run 4", "peer P2 connect")
    desk.until_status("R2", "7006")
    receives(desk, "R2", "P2")
    desk.close()


@KERNELS
def test_stop_and_run_find_old_and_new_connects_again(tmp_path: Path, kernel: str) -> None:
    desk = plain_desk(tmp_path, kernel)
    desk.say("add connect C2 type=TCON_IP_RFC LocalTSelector=E0.02 IsoPort=0")
    desk.say("add instance R2 block=TRCV_C connect=C2 data=rx CONT=1 EN_R=1", "run 4")
    desk.say("plc stop", "run 2", "plc run", "run 4", "peer P1 close", "run 1", "peer P1 connect")
    desk.until_status("R1", "7006")
    desk.say("add peer P2 remote=@C2 iso=true local_tsap=E0.01 remote_tsap=E0.02", "peer P2 connect")
    desk.until_status("R2", "7006")
    desk.close()
