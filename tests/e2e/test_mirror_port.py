"""A switch that floods like a hub, two ends, and `watch -` at a third port: nothing touches the line."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

# In a network of its own: a bridge that learns no addresses, a port each for PLC, partner and mirror.
PORTS = """
set -e
mount -t tmpfs none /run && mkdir -p /run/netns
ip link add sw type bridge ageing_time 0
ip link set sw up
for n in 1 2 3; do
  ip netns add n$n
  ip link add p$n type veth peer name eth0 netns n$n
  ip link set p$n master sw up
  ip -n n$n link set eth0 up
done
ip -n n1 addr add 10.7.0.1/24 dev eth0
ip -n n2 addr add 10.7.0.2/24 dev eth0
"""
PLC = """
import socket
with socket.create_server(("10.7.0.1", 2000)) as door:
    print("ready", flush=True)
    with door.accept()[0] as line:
        while data := line.recv(100):
            line.sendall(data[:5])
"""
PARTNER = """
import select, socket, sys
with socket.create_connection(("10.7.0.1", 2000)) as line:
    while not select.select([sys.stdin], [], [], 0.05)[0]:
        line.sendall(bytes(12))
        line.recv(100)
"""
CAPTURES = {
    "dumpcap": "dumpcap -q -i eth0 -w -",
    "dumpcap in pcap": "dumpcap -q -P -i eth0 -w -",
    "tcpdump": "tcpdump -U --immediate-mode -i eth0 -w -",
}


def whole_line(capture: str) -> str:
    """Return the script: what plays, and what looks on."""
    python = sys.executable
    watch = f"{python} -m trcvtui watch - --format jsonl --plc 10.7.0.1:2000"
    return f"""{PORTS}
exec 3<&0
ip netns exec n1 {python} -c '{PLC}' </dev/null | {{
  read ready
  ip netns exec n2 {python} -c '{PARTNER}' <&3 &
  ip netns exec n3 {capture} 2>/dev/null | {watch}
}}
"""


@pytest.mark.live
@pytest.mark.parametrize("name", CAPTURES)
def test_shadows_at_a_mirror_port_show_what_the_plc_shows(name: str) -> None:
    program = CAPTURES[name].split()[0]
    for needed in (program, "unshare", "ip"):
        if shutil.which(needed) is None:
            pytest.skip(f"needs {needed}")
    alone = ["unshare", "-n", "-m", "sh", "-c"]
    tried = subprocess.run([*alone, PORTS], capture_output=True, text=True, check=False)
    if tried.returncode:
        pytest.skip(f"needs a network of its own with a bridge and veth: {tried.stderr.strip()[-80:]}")
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    command = ["unshare", "-n", "-m", "--kill-child", "--fork", "-p", "sh", "-c", whole_line(CAPTURES[name])]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, env=environment) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        sizes: dict[str, list[int]] = {"C1_TO_PLC": [], "C1_FROM_PLC": []}
        try:
            while not all(len(each) > 3 for each in sizes.values()):
                record = json.loads(process.stdout.readline())
                if record.get("DONE"):
                    sizes[record["instance"]].append(record["RCVD_LEN"])
        finally:
            process.kill()
    # Ad hoc takes what has come by a scan: of ends on a busy machine that may be more than one message.
    assert {size % 12 for size in sizes["C1_TO_PLC"]} == {0}
    assert {size % 5 for size in sizes["C1_FROM_PLC"]} == {0}
