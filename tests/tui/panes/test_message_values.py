"""Random messages of random types: table, bytes and members have the values of `udt decode`."""

from __future__ import annotations

import asyncio

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.report.test_message_table import row_of
from tests.tui.fakes import bench_project, picture
from tests.tui.looking import looking
from tests.udt.udt_strategies import layouts
from trcvtui.errors import one_line
from trcvtui.history.messages import MessagesDelta
from trcvtui.project.project import DataDecl
from trcvtui.tui.panes.message_list import fit_text
from trcvtui.tui.view_model.known_messages import KnownMessages
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.report import member_rows

MESSAGES = st.tuples(layouts(), st.binary(max_size=80), st.booleans())


async def have_the_values_of_udt_decode(drawn: list[tuple[Layout, bytes, bool]]) -> None:
    async with looking((200, 80)) as looker:
        await looker.press("D")
        view, main = looker.app.view_model, looker.app.main
        face, members, own = main.received.table, main.table, bench_project()
        for layout, start, is_whole in drawn:
            content = start.ljust(layout.size, start[:1] or b"\7") if is_whole else start
            data = DataDecl("rx", "T", layout.type, layout, layout.size)
            view._accept_project(replace(own, data=(data, *(each for each in own.data if each.name != "rx"))))
            view.known_messages = KnownMessages()
            view.known_messages.make_request("TRCV_C_1")
            row = row_of(content, scan=1)
            await looker.show(replace(picture(), messages=MessagesDelta("TRCV_C_1", 0, 1, (row,))))
            await looker.settle()
            said = [value for *_, value in member_rows(layout, content, "T", missing="")]
            shown = [text for text, _ in face.messages.row_at(0).parts[1 + len(face.messages.columns) :]]
            widths = [width for _, width in face.messages.members]
            assert shown == [
                fit_text(one_line(each), width) for each, width in zip(said, widths, strict=False)
            ]
            assert face._bytes.content == content and members._bytes() == content
            for place, value in enumerate(said[: members.size.height]):
                text = members.row_at(place).parts[5][0]
                assert text == value if value else text == "-" or text.endswith(" B"), (place, value)


@pytest.mark.slow
@settings(max_examples=4, deadline=None, phases=[Phase.generate])  # each opens a screen: shrinking takes long
@given(st.lists(MESSAGES, min_size=6, max_size=6))
def test_table_bytes_and_members_have_the_values_of_udt_decode(
    drawn: list[tuple[Layout, bytes, bool]],
) -> None:
    asyncio.run(have_the_values_of_udt_decode(drawn))
