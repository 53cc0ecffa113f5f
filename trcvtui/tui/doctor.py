"""The Doctor card: what is wrong with the selected instance, the evidence, and the remedy."""

from __future__ import annotations

from typing import ClassVar, Final, NamedTuple

from trcvtui.bench.doctor_requests import HEALTHY, findings_of
from trcvtui.snapshots.doctor import DoctorSnapshot, Finding
from trcvtui.tui.formatting import clip, measure, pad
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.dialogs import LabelledText, ViewDialog
from trcvtui.tui.widgets.line_view import Part, Row, hidden_bindings, row, rule
from trcvtui.wording import count, stamp_text

SURE_CONFIDENCE: Final = 0.85
MOST_PACKETS: Final = 8
DIRECTION_NAMES: Final = {"to-plc": "to the PLC", "from-plc": "from the PLC", "": ""}


class DoctorTarget(NamedTuple):
    """Where the card leads: to the prompt with `line`, or to a scan or a byte of an instance's stream."""

    line: str = ""
    instance: str = ""
    scan: int | None = None
    byte: int | None = None


class FindingList(LabelledText):
    """The findings, then evidence, place and remedy of the finding under the cursor."""

    def __init__(self, view_model: ViewModel) -> None:
        super().__init__(id="doctor")
        self._view_model = view_model
        self.cursor = 0
        self.of_all = False

    @property
    def snapshot(self) -> DoctorSnapshot:
        picture = self._view_model.live
        return picture.doctor if picture is not None else DoctorSnapshot()

    @property
    def findings(self) -> tuple[Finding, ...]:
        return self._filter_by_instance(self.snapshot.findings)

    def _filter_by_instance(self, some: tuple[Finding, ...]) -> tuple[Finding, ...]:
        name = "" if self.of_all else self._view_model.selected
        return findings_of(name, some, self._view_model.project)

    @property
    def chosen_finding(self) -> Finding | None:
        found = self.findings
        return found[min(self.cursor, len(found) - 1)] if found else None

    def make_rows(self) -> list[Row]:
        seen, found, chosen = self.snapshot, self.findings, self.chosen_finding
        since, _, step = seen.progress.partition(": ")
        again = f" · again, {since}: {step.rpartition(': ')[2]}".rstrip(": ") if seen.looks and since else ""
        head = clip(clip(self._describe_state(), self._width - measure(again)) + again, self._width)
        rows = [row((head, "warn" if seen.trouble else "dim"))]
        if seen.qualities:
            rows.append(row((clip(" · ".join(seen.qualities), self._width), "dim")))
        rows += [self._finding_row(number, one) for number, one in enumerate(found)]
        rows += self._detail_rows(chosen) if chosen is not None else []
        remarks = self._filter_by_instance(seen.remarks)
        rows += [rule(self._width, ("── remarks ", "dim"))] if remarks else []
        return [*rows, *(self._remark_row(one) for one in remarks)]

    def _remark_row(self, one: Finding) -> Row:
        whose = one.instance or one.connect if self.of_all else ""
        text = ": ".join(filter(None, (whose, one.title or one.cause, *one.evidence[:1])))
        return row((clip(text, self._width), "dim"))

    def _describe_state(self) -> str:
        seen = self.snapshot
        if not seen.looks:
            return f"the doctor looks, {seen.progress}" if seen.progress else "the doctor looks …"
        if seen.trouble:
            return seen.trouble
        is_file = self._view_model.position is not None
        how_far = "in the whole file" if is_file else f"up to scan {seen.scan}"
        scope = f"{count(seen.conversations, 'conversation')} looked at, {how_far}"
        if self.findings:
            return scope
        others = len(seen.findings)
        return f"{HEALTHY}: {scope}" + (f"; {count(others, 'finding')} elsewhere: press a" if others else "")

    def _finding_row(self, number: int, one: Finding) -> Row:
        confidence = f"{one.confidence:.0%} sure"
        whose = one.instance or one.connect
        room = self._width - len(confidence) - 3
        is_chosen = one is self.chosen_finding
        text = f"{number + 1} {one.cause}" + (f"  {whose}" if whose else "")
        parts: list[Part] = [
            ("▸ " if is_chosen else "  ", "key"),
            (pad(clip(text, room), room + 1), "strong"),
            (confidence, "on" if one.confidence >= SURE_CONFIDENCE else "warn"),
        ]
        return row(*parts, style="cursor" if is_chosen else "")

    def _detail_rows(self, one: Finding) -> list[Row]:
        rows = self._labelled_rows("", [one.title] if one.title else [], "strong")
        rows.append(rule(self._width, ("── evidence ", "dim")))
        rows += self._labelled_rows("", one.evidence, "")
        rows += self._labelled_rows("explains", one.explains, "") if one.explains else []
        where = " · ".join(filter(None, (str(one.ends or ""), DIRECTION_NAMES[one.way])))
        rows += self._labelled_rows("line", [where], "dim") if where else []
        rows += self._labelled_rows("STATUS", [", ".join(one.status)], "") if one.status else []
        numbers = ", ".join(map(str, one.packets[:MOST_PACKETS])) + " …" * (len(one.packets) > MOST_PACKETS)
        shown = " · ".join(filter(None, (numbers, one.filter)))
        rows += self._labelled_rows("packets", [shown], "dim") if shown else []
        place, stream = self.find_target(), self.find_target(of_byte=True)
        if place is not None:
            when = "" if one.t_ns is None else f", {stamp_text(one.t_ns)} s"
            rows += self._labelled_rows("s", [f"scan {place.scan}{when}"], "key")
        if stream is not None:
            rows += self._labelled_rows("b", [f"byte {stream.byte} of the received bytes"], "key")
        rows.append(rule(self._width, ("── remedy ", "dim")))
        for is_tried, label, style in ((True, "", "strong"), (False, "advice", "")):
            texts = [mend.text for mend in one.mend if mend.tried is is_tried]
            rows += self._labelled_rows(label, texts, style) if texts else []
        remedy = self.remedy_line()
        rows += self._labelled_rows("enter", [f"types `{remedy}`"], "key") if remedy else []
        return rows

    # -- where the keys go --------------------------------------------------------------------------------

    @property
    def _finding_instance(self) -> str:
        one, selected = self.chosen_finding, self._view_model.instance
        if one is None or one.instance or (selected is not None and selected.connect in (one.connect, "")):
            return one.instance if one is not None and one.instance else self._view_model.selected
        on_it = [each.name for each in self._view_model.instances if each.connect == one.connect]
        return next(iter(on_it), self._view_model.selected)

    def find_target(self, of_byte: bool = False) -> DoctorTarget | None:
        """Return the chosen finding's scan, or with `of_byte` its byte in the stream; None if unknown."""
        one, snapshot = self.chosen_finding, self._view_model.snapshot
        if one is None or snapshot is None:
            return None
        if of_byte:
            links = [each for each in snapshot.connections if each.name == one.connect]
            is_first = bool(links) and links[0].incarnation <= 1  # a later one starts anywhere in the stream
            if one.byte is None or one.way != "to-plc" or not is_first:
                return None
            return DoctorTarget(instance=self._finding_instance, byte=one.byte)
        scan = one.scan
        if scan is None and one.t_ns is not None and one.t_ns >= 0:  # by the ledger, or else by the interval
            t_ns = one.t_ns
            known = (line.scan for line in self._view_model.lines if line.t_ns >= t_ns)
            scan = next(known, max(1, snapshot.scan - (snapshot.t_ns - t_ns) // max(snapshot.interval_ns, 1)))
        return None if scan is None else DoctorTarget(instance=self._finding_instance, scan=scan)

    def remedy_line(self) -> str:
        """Return the line that applies the remedy, if any: a bench command, or `if` in a recording."""
        one, picture = self.chosen_finding, self._view_model.live
        if one is None or picture is None:
            return ""
        if picture.position is not None:
            return next((f"if {mend.set}" for mend in one.mend if mend.set), "")
        return next((mend.command for mend in one.mend if mend.command), "")

    def action_page(self, pages: int) -> None:
        self.scroll_relative(y=pages * (self.size.height - 1), animate=False)

    def action_move(self, rows: int) -> None:
        self.cursor = max(0, min(len(self.findings) - 1, self.cursor + rows))
        self.scroll_to(y=0, animate=False)
        self.draw()


class DoctorScreen(ViewDialog[DoctorTarget | None]):
    """Returns the place to go to; while this screen is open, the doctor keeps checking."""

    BINDINGS: ClassVar = hidden_bindings({
        "enter": "remedy", "s": "place(False)", "b": "place(True)", "a": "others", "J": "leave",
    })  # fmt: skip
    DEFAULT_CSS = """
    DoctorScreen FindingList {
        width: 100; height: auto; max-height: 100%; border-subtitle-color: $foreground;
    }
    """

    def __init__(self, view_model: ViewModel) -> None:
        self._view_model = view_model
        self.list = FindingList(view_model)
        super().__init__(self.list, None)

    def on_mount(self) -> None:
        self._view_model.doctor_wanted = True
        self.show()

    def on_unmount(self) -> None:
        self._view_model.doctor_wanted = False

    def show(self) -> None:
        shown = self.list
        shown.set_title(None, "Doctor", "all" if shown.of_all else self._view_model.selected)
        keys = {
            "↑↓ choose": len(shown.findings) > 1,
            "s scan": shown.find_target() is not None,
            "b byte": shown.find_target(of_byte=True) is not None,
            "enter remedy": bool(shown.remedy_line()),
            "a one" if shown.of_all else "a all": True,
            "esc": True,
        }
        shown.border_subtitle = " · ".join([key for key, leads in keys.items() if leads])
        shown.draw()

    def action_remedy(self) -> None:
        remedy = self.list.remedy_line()
        if remedy:
            self.dismiss(DoctorTarget(remedy))

    def action_place(self, of_byte: bool) -> None:
        place = self.list.find_target(of_byte)
        if place is not None:
            self.dismiss(place)

    def action_others(self) -> None:
        self.list.of_all, self.list.cursor = not self.list.of_all, 0
        self.show()
