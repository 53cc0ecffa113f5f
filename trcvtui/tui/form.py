"""The form of a UDT payload: which type it is for, and what its members hold already."""

from __future__ import annotations

from typing import TYPE_CHECKING

from trcvtui.errors import UserError
from trcvtui.tui.peer_commands import UDT
from trcvtui.tui.scene import Scene

if TYPE_CHECKING:
    from trcvtui.tui.screens.udt_form import UdtForm


def form_of(text: str, mode: str, scene: Scene) -> UdtForm | None:
    """Return the form of the UDT that a payload names, else of DATA, else of the first; None without UDTs."""
    from trcvtui.tui.screens.udt_form import UdtForm  # read when first asked for
    from trcvtui.udt.layout import lay_out

    types, declared = scene.project.types, scene.declaration
    first = text.split("{")[0].strip() if mode == UDT else ""
    names = [first, declared.type_name if declared else "", *types.names()]
    name = next((name for name in names if name.casefold() in types.types), "")
    if not name:
        return None
    layout = lay_out(types.named(name), scene.project.layout, name)
    values = _values(text, scene) if mode == UDT and name == first else {}
    return UdtForm(scene.project, scene.peer, name, layout, values)


def _values(text: str, scene: Scene) -> dict[str, str]:
    """Return the members that a payload sets, as it writes them; none where it cannot be read."""
    from trcvtui.rig.member_values import members_of  # read when first asked for

    try:
        return dict(members_of(text[text.index("{") :].strip(), "form"))
    except (UserError, ValueError):
        return {}
