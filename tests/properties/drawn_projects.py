"""Projects drawn at random: blocks that share CONNECTs, DATA and tasks, with switches that make it tight."""

from __future__ import annotations

from typing import Any, Final

from hypothesis import strategies as st

from trcvtui.blocks.table import block_row

Document = dict[str, Any]

BLOCKS: Final = (
    *("TRCV_C", "TSEND_C") * 4,
    *("TRCV", "TSEND") * 2,
    *("TCON", "TDISCON", "T_RESET"),
)
DATA: Final = {"D1": 8, "D2": 5, "D3": 64, "D4": 30_000}  # D4: more than a small send buffer takes at once
OPTIONS: Final = {
    "lock_across_tasks": st.booleans(),
    "small_buffers": st.sampled_from((True, True, False)),
    "second_client": st.sampled_from(("reject", "replace", "queue")),
    "not_connected": st.sampled_from(("pulse", "hold", "never")),
    "short_frame": st.sampled_from(("both", "80C5")),
    "reset_is": st.sampled_from(("80AA", "80C5")),
    "com_rst_autoclear": st.booleans(),
    "user_timeout": st.booleans(),
    "buffers": st.sampled_from((64, 64, 64, 2)),
    "queue": st.sampled_from((64, 64, 64, 1)),
}
INTERVALS: Final = ("T#10ms", "T#20ms", "T#25ms", "T#70ms")


@st.composite
def projects(draw: st.DrawFn) -> Document:
    """Return a project: one to three CONNECTs, two to six instances on them, one to three tasks."""
    connects = _connects(draw, draw(st.sampled_from((1, 1, 2, 3))))
    tasks = [_task(draw, number) for number in range(1, draw(st.integers(1, 3)) + 1)]
    count = draw(st.integers(2, 6))
    return {
        "dialect": "baosky",
        "options": {"retry": "T#50ms", "attempt_limit": "T#200ms", **draw(st.fixed_dictionaries(OPTIONS))},
        "sim": {"seed": draw(st.integers(0, 3)), "fragment": draw(st.booleans())},
        "task": tasks,
        "data": [{"name": name, "type": f"ARRAY[1..{size}] OF BYTE"} for name, size in DATA.items()],
        "connect": connects,
        "instance": [_instance(draw, f"I{n}", connects, tasks) for n in range(1, count + 1)],
        "peer": _peers(connects),
    }


def _connects(draw: st.DrawFn, count: int) -> list[Document]:
    """Return CONNECTs; an active one connects to its peer, or to an earlier CONNECT of the same PLC."""
    connects: list[Document] = []
    for name in [f"C{number}" for number in range(1, count + 1)]:
        connect: Document = {"name": name, "LocalAddress": "127.0.0.1", "KeepAliveTimeInterval": 1}
        if draw(st.booleans()):
            passive = [f"@{c['name']}" for c in connects if "RemotePort" not in c]
            ends = (f"@P{name[1:]}", f"@P{name[1:]}", *passive)
            connect |= {
                "ActiveEstablished": True,
                "RemoteAddress": "127.0.0.1",
                "RemotePort": draw(st.sampled_from(ends)),
            }
        connects.append(connect)
    return connects


def _peers(connects: list[Document]) -> list[Document]:
    """Return a partner for each CONNECT, and one more client for the first passive one."""
    peers: list[Document] = []
    passive = [c["name"] for c in connects if "RemotePort" not in c]
    for name in [c["name"] for c in connects]:
        way = {"remote": f"@{name}"} if name in passive else {"local": "127.0.0.1:0"}
        peers.append({"name": f"P{name[1:]}", "active": name in passive, **way})
    for name in passive[:1]:
        peers.append({"name": "Q", "active": True, "remote": f"@{name}"})
    return peers


def _task(draw: st.DrawFn, number: int) -> Document:
    interval = draw(st.sampled_from(INTERVALS)) if number > 1 else "T#10ms"
    return {"name": f"T{number}", "interval": interval, "priority": draw(st.integers(1, 3))}


def _instance(draw: st.DrawFn, name: str, connects: list[Document], tasks: list[Document]) -> Document:
    block = draw(st.sampled_from(BLOCKS))
    instance = {
        "name": name,
        "block": block,
        "connect": draw(st.sampled_from(connects))["name"],
        "task": draw(st.sampled_from(tasks))["name"],
    }
    data = draw(st.sampled_from((*tuple(DATA) * 3, "")))  # without DATA: 80A4
    if block_row(block).uses_network and data:
        instance["data"] = data
    return instance
