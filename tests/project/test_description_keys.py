"""What `save project` writes of a connection description is read as that CONNECT again."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.commands.table import parse_line
from trcvtui.commands.words import Add
from trcvtui.engine.project_edits import save_project
from trcvtui.project.edit import adding
from trcvtui.project.file import load_project, read_project
from trcvtui.project.keys import keys_of

HEAD = 'dialect = "s7-1500"\n'
NAMED = 'type = "TCON_QDN"\nActiveEstablished = true\nRemoteQDN = "a.b."\nRemotePort = 2000'
WRITTEN = {
    "plain": "",
    "tcp": 'type = "TCON_IP_v4"\nLocalPort = 2000\nListenPort = 0',
    "its own port": 'type = "TCON_IP_v4"\nLocalPort = 2000',
    "a free port": 'type = "TCON_IP_v4"\nListenPort = 0',
    "no port": 'type = "TCON_IP_v4"',
    "active": 'type = "TCON_IP_v4"\nActiveEstablished = true\nRemoteAddress = "10.0.0.7"\nRemotePort = 2000',
    "peer": 'ActiveEstablished = true\nRemoteAddress = "127.0.0.1"\nRemotePort = "@P1"',
    "udp": 'type = "TCON_IP_v4"\nConnectionType = 19\nLocalPort = 2000\nKeepAliveTimeInterval = 3',
    "iso": 'type = "TCON_IP_RFC"\nLocalTSelector = "16#E002"\nIsoPort = 0',
    "iso active": (
        'type = "TCON_IP_RFC"\nActiveEstablished = true\nRemoteAddress = "127.0.0.1"\n'
        'LocalTSelector = "16#E002"\nRemoteTSelector = "TCP-1"\nIsoPort = "@P1"'
    ),
    "param": 'type = "TCON_Param"\nactive_est = false\nlocal_tsap_id = "07 d0"',
    "name": NAMED + '\nDnsAnswer = "127.0.0.1"',
    "no server": NAMED + '\nDnsAnswer = "none"',
    "unknown": NAMED + '\nDnsAnswer = "0.0.0.0"',
    "asked": NAMED,
    "unsafe": (
        'type = "TCON_IP_V4_SEC"\nActivateSecureConn = true\nActiveEstablished = true\n'
        'RemoteAddress = "127.0.0.1"\nRemotePort = 2000\nverify = "none, this is unsafe"'
    ),
    "bytes": 'bytes = "00 40 00 01 0b"',
    "wrong length": 'type = "TCON_IP_RFC"\nbytes = "00 40 00 01 0b 01 c0 a8 00 0a 07 d0 00 00"',
}


@pytest.mark.parametrize("what", WRITTEN)
def test_the_keys_of_a_description_are_read_as_that_connect_again(what: str) -> None:
    peer = '[[peer]]\nname = "P1"\n'
    [first] = read_project(
        tomllib.loads(f'{HEAD}{peer}[[connect]]\nname = "C1"\n{WRITTEN[what]}'), "b.toml", Path(".")
    ).connects
    document = tomllib.loads(HEAD + peer) | {"connect": [{"name": "C1", **dict(keys_of(first))}]}
    [again] = read_project(document, "b.toml", Path(".")).connects
    assert again == first


def test_an_added_connect_of_iso_on_tcp_and_its_peer_can_be_saved(tmp_path: Path) -> None:
    project = load_project(CONFIGS / "s7-receiver.toml")
    lines = (
        "add connect C2 type=TCON_IP_RFC LocalTSelector=E0.02 IsoPort=0",
        "add peer P2 active=false iso=true local_tsap=E0.01 remote_tsap=E0.02 tpdu=256",
    )
    added = [command.decl for line in lines if isinstance(command := parse_line(line, project, "w"), Add)]
    assert len(added) == 2
    saved = save_project(
        project.path, tmp_path / "x.toml", tuple(adding(decl, project) for decl in added), "w", {}
    )
    assert saved.connect("C2") == added[0]
    assert saved.peer("P2") == added[1]
