"""The ways of a tap to its children: the process that serves one may die in the middle of a block."""

from __future__ import annotations

import os

import pytest

from trcvtui.capture.pcap import packet_block
from trcvtui.net.os.packet_pipe import PacketPipe
from trcvtui.net.os.tap_channels import ChannelServer, TapChannel

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(os.name != "posix", reason="the system hands no descriptors over"),
]
BLOCK = packet_block(0, 1, b"abcd")


@pytest.mark.parametrize("cut", [3, 7, len(BLOCK) - 1])
def test_a_child_reads_whole_blocks_from_one_way_after_the_other(cut: int) -> None:
    tap = ChannelServer()
    ways = [
        way
        for way in (tap.hand_over_channel(), tap.hand_over_channel(), tap.hand_over_channel())
        if way is not None
    ]
    for way, said in zip(ways, (BLOCK + BLOCK[:cut], b"", BLOCK), strict=True):
        way.sendall(said)
    with tap.theirs as asks:
        child = TapChannel(asks.fileno())
        pipe = PacketPipe(child.fd, lambda _: None, child.feed)
        got = [pipe.read(1 << 16)]
        child.send(b"an order that is never read\n")
        for way in ways:
            way.close()
        got.append(pipe.read(1 << 16))
        tap.close()
        got.append(pipe.read(1 << 16))
        os.close(child.fd)
    assert got == [BLOCK, BLOCK, b""]
