"""Which wire a peer hangs on: the CONNECT or UDP_CONFIG that it talks to."""

from __future__ import annotations

from trcvtui.project.project import PeerDecl, Project


def link_of(peer: PeerDecl, project: Project) -> str:
    """Return the name that `link NAME down` needs for this peer, "" where no CONNECT leads to it."""
    end = peer.remote if peer.udp else peer.end
    if isinstance(end, str):
        return end.removeprefix("@")
    for config in project.connects:
        if config.remote_port == f"@{peer.name}":
            return config.name
    for addr in project.addrs:
        if addr.remote_port == f"@{peer.name}":
            return next((i.connect for i in project.instances if i.addr == addr.name), "")
    if end is None:
        return ""
    ports = [(c.name, c.local.port if peer.active else c.remote_port) for c in project.connects]
    return next((name for name, port in ports if port == end.port != 0), "")
