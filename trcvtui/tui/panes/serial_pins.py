"""What stands at the pins of a block on a ComBuffer that no scan writes, and the command that changes it."""

from __future__ import annotations

from typing import Final

from trcvtui.plc.snapshot import FramerSnapshot, InstanceSnapshot
from trcvtui.plc.wired_pins import BUFFER_PINS, DATA_PINS
from trcvtui.tui.formatting import clip
from trcvtui.tui.view_model.view_model import Scene

SHOWN: Final = 9  # columns of a mark inside the box
NULL: Final = "0"
FEEDABLE: Final = ("sim", "serial")


def wired_value(pin: str, instance: InstanceSnapshot) -> str:
    """Return what stands at such a pin: bytes of a mark, a variable, a ComBuffer."""
    if pin in BUFFER_PINS:
        return clip(instance.connect, SHOWN)
    if pin in DATA_PINS:
        return clip(instance.data or NULL, SHOWN)
    mark = mark_of(pin, instance.framer)
    if mark is None:
        return NULL
    return clip(mark.hex(" ").upper(), SHOWN) if mark else "none"


def mark_of(pin: str, framer: FramerSnapshot | None) -> bytes | None:
    """Return the bytes of a prefix or suffix pin, None where the pointer is 0."""
    if framer is None:
        return None
    return framer.prefix if pin.endswith("Prefix") else framer.suffix


def line_for(pin: str, instance: InstanceSnapshot, scene: Scene) -> str:
    """Return the beginning of the command that changes what stands at such a pin, "" where nothing does."""
    if pin in BUFFER_PINS:
        decl = next((b for b in scene.project.combuffers if b.name == instance.connect), None)
        return f"feed {instance.connect} hex " if decl is not None and decl.source in FEEDABLE else ""
    if pin in DATA_PINS:
        decl_data = scene.project.data_decl(instance.data) if instance.data else None
        return f"resize {decl_data.name} {decl_data.type_name}" if decl_data is not None else ""
    mark = mark_of(pin, instance.framer)
    if mark is None:
        return ""
    written = f"hex {mark.hex(' ')}" if mark else "hex "
    return f"{'prefix' if pin.endswith('Prefix') else 'suffix'} {instance.name} {written}"


def why_not(pin: str, instance: InstanceSnapshot) -> str:
    """Return why such a pin cannot be changed here."""
    if pin in BUFFER_PINS:
        return f"{instance.connect} is not a simulated line: its bytes come from elsewhere"
    return f"{pin} of {instance.name} is 0: the project names its variable, `{pin} = ...`"
