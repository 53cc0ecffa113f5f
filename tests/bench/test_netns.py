"""`link C1 down` and what the ledger says of it; `--netns`: a network of its own, whose loopback is cut."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import trcvtui.net.os.network as os_namespace
from tests.local_driver import wait_for
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.cli.main import main
from trcvtui.cli.options import KERNELS
from trcvtui.commands.words import SetLink
from trcvtui.engine.driver import EngineDriver
from trcvtui.plc.ledger import BenchNote
from trcvtui.scenario.scenario import load_bench_project

PASSIVE = str(CONFIGS / "passive.toml")
TWO_ADDRESSES = """
dialect = "baosky"
[sim]
addresses = ["10.0.0.1"]
not_ethernet = ["10.0.0.2"]
[[data]]
name = "rx"
type = "ARRAY[0..1] OF BYTE"
[[connect]]
name = "C1"
LocalAddress = "10.0.0.1"
[[connect]]
name = "C2"
LocalAddress = "127.0.0.1"
[[connect]]
name = "C3"
LocalAddress = "10.0.0.2"
[[instance]]
name = "ON_C1"
block = "TRCV_C"
connect = "C1"
data = "rx"
[[instance]]
name = "ON_C2"
block = "TRCV_C"
connect = "C2"
data = "rx"
[[instance]]
name = "ON_C3"
block = "TRCV_C"
connect = "C3"
data = "rx"
[[peer]]
name = "P1"
active = true
remote = "@C1"
[[peer]]
name = "P2"
active = true
remote = "@C2"
[scenario]
name = "two wires"
steps = '''
set ON_C1 CONT=1 EN_R=1
set ON_C2 CONT=1 EN_R=1
wait ON_C1 STATUS=7002
peer P1 connect
peer P2 connect
wait ON_C1 STATUS=7006
wait ON_C2 STATUS=7006
link C1 down
peer P1 send hex 01 02
peer P2 send hex 03 04
run T#100ms
expect ON_C1 STATUS=7006
expect ON_C2 STATUS=7006
{then}
'''
"""
MEND = "link C1 up\nwait ON_C1 STATUS=7008 within T#2s\nset ON_C3 CONT=1\nwait ON_C3 STATUS=8081"


def run_alone(*args: str) -> subprocess.CompletedProcess[str]:
    """Run a process of its own: a process stays in the network that it has entered."""
    command = [sys.executable, *args]
    root = str(Path(__file__).parents[2])
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, cwd=root)
    if "--netns: found a system" in done.stderr:
        pytest.skip("this system allows no network of its own: " + done.stderr.splitlines()[-1])
    return done


@pytest.mark.slow
def test_loopback_of_the_own_network_goes_down_for_every_connect_and_each_file_has_a_fresh_one(
    tmp_path: Path,
) -> None:
    left_down, mended = tmp_path / "down.toml", tmp_path / "mended.toml"
    left_down.write_text(TWO_ADDRESSES.replace("{then}", "expect ON_C1 STATUS=7006"), encoding="utf-8")
    mended.write_text(TWO_ADDRESSES.replace("{then}", MEND), encoding="utf-8")
    files = [str(left_down), str(mended)]
    done = run_alone("-m", "trcvtui", "scenario", *files, "--kernel", "live", "--netns")
    assert (done.returncode, done.stderr) == (0, ""), done.stdout


def test_in_the_own_network_the_ledger_names_the_interface() -> None:
    script = (
        "from trcvtui.errors import UserError\n"
        "from trcvtui.net.os.kernel import OsKernel\n"
        "from trcvtui.bench import bench as wire\n"
        "try:\n    wire.enter_own_network('live')\n"
        "except UserError as refused:\n    raise SystemExit(str(refused))\n"
        "for up in (False, True):\n    print(wire.set_link(OsKernel(), 'C1', up))"
    )
    assert run_alone("-c", script).stdout.splitlines() == [
        "('', 'interface lo down: it carries every CONNECT and peer')",
        "('', 'interface lo up')",
    ]


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_ledger_says_by_what_means_the_wire_was_cut(kernel: str) -> None:
    bench = Bench(load_bench_project(Path(PASSIVE)), kernel)
    try:
        assert bench.do(SetLink("C1", up=False)) == bench.do(SetLink("C1", up=True)) == ""
        notes = [line.event for line in bench.runtime.ledger if isinstance(line.event, BenchNote)]
    finally:
        bench.close()
    means = {"sim": ["simulated wire"] * 2, "live": ["packets dropped at the sockets", "packets pass again"]}
    said = [
        BenchNote("C1", what, by) for what, by in zip(("link down", "link up"), means[kernel], strict=True)
    ]
    assert [note for note in notes if note.subject == "C1"] == said


@pytest.mark.slow
def test_the_engine_of_a_screen_gets_a_network_of_its_own_too() -> None:
    run_alone("-c", "from trcvtui.bench.bench import enter_own_network as enter; enter('live')")
    driver = EngineDriver(Path(PASSIVE), "live", netns=True)
    try:
        driver.submit("link C1 down")
        picture = wait_for(driver, lambda p: bool(p.answers))
    finally:
        driver.close()
    assert [answer.error for answer in picture.answers] == [""]
    notes = [line.event for line in picture.lines if isinstance(line.event, BenchNote)]
    assert BenchNote("C1", "link down", "interface lo down: it carries every CONNECT and peer") in notes


# -- where it cannot be ------------------------------------------------------------------------------------


TWO_HOSTS = """
set -e
mount -t tmpfs none /run && mkdir -p /run/netns
for n in 1 2; do ip netns add n$n; done
ip -n n1 link add eth0 type veth peer name eth0 netns n2
for n in 1 2; do
  ip -n n$n link set eth0 up
  ip -n n$n addr add 10.7.0.$n/16 dev eth0
done
"""
ON_VETH = """
dialect = "s7-1200"
[[data]]
name = "rx"
type = "ARRAY[0..3] OF BYTE"
[[connect]]
name = "C1"
type = "TCON_IP_v4"
ConnectionType = 19
LocalAddress = "10.7.0.1"
LocalPort = 2000
[[addr]]
name = "SOURCE"
[[addr]]
name = "ALL"
RemoteAddress = "10.7.255.255"
RemotePort = 2001
[[instance]]
name = "TCON_1"
block = "TCON"
connect = "C1"
[[instance]]
name = "TURCV_1"
block = "TURCV"
connect = "C1"
addr = "SOURCE"
data = "rx"
[[instance]]
name = "TUSEND_1"
block = "TUSEND"
connect = "C1"
addr = "ALL"
data = "rx"
LEN = 4
[scenario]
name = "a broadcast to each end"
steps = '''
pulse TCON_1 REQ
wait TCON_1 DONE=1
set TURCV_1 EN_R=1
wait TURCV_1 STATUS=0000 within T#60s
expect rx hex 61 6C 6C 21
pulse TUSEND_1 REQ
wait TUSEND_1 DONE=1
'''
"""
CALLS = """
import socket
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here:
    here.bind(("", 2001))
    here.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
    here.settimeout(0.05)
    while True:
        here.sendto(b"all!", ("10.7.255.255", 2000))
        try:
            data, source = here.recvfrom(100)
            if source[0] != "10.7.0.2":
                print(data, source)
                break
        except TimeoutError:
            pass
"""


@pytest.mark.live
def test_a_broadcast_crosses_a_veth_pair_in_both_directions(tmp_path: Path) -> None:
    for needed in ("unshare", "ip"):
        if shutil.which(needed) is None:
            pytest.skip(f"needs {needed}")
    alone = ["unshare", "-n", "-m", "--kill-child", "--fork", "-p", "sh", "-c"]
    tried = subprocess.run([*alone, TWO_HOSTS], capture_output=True, text=True, check=False)
    if tried.returncode:
        pytest.skip(f"needs a network of its own with a veth pair: {tried.stderr.strip()[-80:]}")
    (tmp_path / "veth.toml").write_text(ON_VETH, encoding="utf-8")
    (tmp_path / "calls.py").write_text(CALLS, encoding="utf-8")
    plc = f"ip netns exec n1 {sys.executable} -m trcvtui scenario {tmp_path / 'veth.toml'} --kernel live"
    partner = f"ip netns exec n2 timeout 60 {sys.executable} {tmp_path / 'calls.py'}"
    done = subprocess.run(
        [*alone, f"{TWO_HOSTS}\n{partner} & {plc}; code=$?; wait; exit $code"],
        capture_output=True, text=True, timeout=100, check=False, cwd=Path(__file__).parents[2],
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "b'all!' ('10.7.0.1', 2000)" in done.stdout


def test_netns_without_the_live_kernel_is_a_mistake(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenario", PASSIVE, "--netns"]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("--netns: found --kernel sim, expected --kernel live")


def test_a_system_that_refuses_is_told_in_one_line_however_many_files(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os_namespace, "_unshare", lambda: "EPERM")
    assert main(["scenario", PASSIVE, PASSIVE, "--kernel", "live", "--netns"]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert "a namespace (EPERM)" in err


def test_a_system_without_namespaces_is_told_in_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    assert main(["scenario", PASSIVE, "--kernel", "live", "--netns"]) == 2
    assert "without network namespaces" in capsys.readouterr().err


def test_the_network_of_everybody_is_never_cut() -> None:
    assert not os_namespace.has_own_network()
    assert os_namespace.set_loopback(up=False) == "this is no network of its own"
