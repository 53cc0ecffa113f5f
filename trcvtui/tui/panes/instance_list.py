"""Pane 1: a line per instance, with partner, STATUS, lamps, bytes of the job and age of the last byte."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar, Final, NamedTuple

from textual.binding import Binding

from trcvtui.diagnosis.link import describe_condition
from trcvtui.plc.snapshot import ConnectionSnapshot, InstanceSnapshot
from trcvtui.project.connect_view import TLS_TEXT, security_of
from trcvtui.tui.formatting import bar, clip, clip_middle, lamp, measure, pad, status_word
from trcvtui.tui.view_model.view_model import DONE, ERROR, PinPulse, ViewModel
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row
from trcvtui.wording import age_text

ROOMY: Final = 110
MIDDLE_WIDTH: Final = 90  # below: only the lamps show a pulse
NARROW_WIDTH: Final = 60  # below: neither partner nor condition, the lamps stay
BAR_WIDTH: Final = 10
MANY_INSTANCES: Final = 8  # with more there are keys to find one
SHADOW_SIGN: Final = "◌"  # before a shadow
EMPTY_HINTS: Final = (
    "  empty: press A, then enter, for an instance with its CONNECT and DATA",
    "  then t raises CONT (it listens) and n raises EN_R (it receives)",
)


class ListColumns(NamedTuple):
    """Widths of columns. With `both` a line shows both ends, with `bar` 0 no bar, number or age."""

    name: int
    partner: int
    word: int
    condition: int
    bar: int
    both: bool
    numbers: int = 0


class InstanceList(LineView):
    """The instances in call order; all panes show the instance under the cursor."""

    DEFAULT_CSS = "InstanceList { height: auto; max-height: 10; min-height: 3; }"
    KEYS: ClassVar = (("↑↓", "instance"), ("A", "add"), ("E", "change"))
    BINDINGS: ClassVar = [
        Binding("slash", "screen.filter", "filter the list by words", show=False),
        Binding("exclamation_mark", "next_error", "the next instance with an ERROR", show=False),
    ]

    def __init__(self, view_model: ViewModel, selected: Callable[[], None], digit: int = 1) -> None:
        """When you choose an instance, `selected` is called at once, to paint all panes together."""
        super().__init__(id="instances")
        self._selected, self._digit, self._view_model = selected, digit, view_model
        self.words: list[str] = []  # of the filter: a listed instance has all of them
        self._listed: Sequence[InstanceSnapshot] = ()
        self._columns = self._measure()

    def keys(self) -> tuple[tuple[str, str], ...]:
        many = self.words or len(self._view_model.instances) > MANY_INSTANCES
        return (*self.KEYS, ("/", "filter"), ("!", "ERROR")) if many else self.KEYS

    def set_filter(self, words: str) -> None:
        self.words = words.casefold().split()
        self.show()
        names = [instance.name for instance in self._listed]
        if self._view_model.selected in names:
            self.keep_in_view(names.index(self._view_model.selected))

    def row_count(self) -> int:
        if self.words:
            return max(1, len(self._listed))
        return len(self._view_model.instances) or len(self._view_model.project.instances) or len(EMPTY_HINTS)

    def show(self) -> None:
        """Repaint changed rows. The title counts instances that match the filter, and those with ERROR."""
        instances = self._view_model.instances
        self._listed = [each for each in instances if self._has_words(each)] if self.words else instances
        details = [f"{len(self._listed)} of {len(instances)} with {' '.join(self.words)}, esc: all"]
        details = details if self.words else []
        if self._view_model.shadows:
            details.append(f"{SHADOW_SIGN} shadow")
        if len(instances) > MANY_INSTANCES and (errors := sum(map(self._shows_error, instances))):
            details.append(f"{errors} with ERROR")
        self.set_title(self._digit, "Instances", " · ".join(details))
        self._columns = self._measure()
        super().show()

    def row_at(self, y: int) -> Row:
        if y < len(self._listed):
            return self._row(self._listed[y], self._columns)
        if self.words:
            return row(("  no instance has these words in name, code, address", "dim")) if y == 0 else EMPTY
        declared = self._view_model.project.instances
        if not declared:
            return row((EMPTY_HINTS[y], "key" if y == 0 else "dim")) if y < len(EMPTY_HINTS) else EMPTY
        return row((f"  {declared[y].name}", "dim")) if y < len(declared) else EMPTY

    def _has_words(self, instance: InstanceSnapshot) -> bool:
        pulses = self._pulses(instance)
        codes = {instance.outputs.status, *(pulse.status for pulse in pulses.values())}
        parts = (
            f"{instance.name} {instance.block} {self._describe_condition(instance)}",
            _partner(self._view_model.connection_of(instance), True),
            " ".join(f"16#{code:04X}" for code in codes),
            "error" if self._shows_error(instance) else "",
        )
        text = " ".join(parts).casefold()
        return all(word in text for word in self.words)

    def _describe_condition(self, instance: InstanceSnapshot) -> str:
        return describe_condition(self._view_model.project, instance.name, instance)

    def _pulses(self, instance: InstanceSnapshot) -> dict[str, PinPulse]:
        """Return the pulses whose lamps still glow, by the style of the lamp."""
        glow, now = self._view_model.afterglow.find_pulse, self._view_model.t_ns
        found = {style: glow(instance.name, lamp, now) for style, lamp in (("done", DONE), ("error", ERROR))}
        return {style: pulse for style, pulse in found.items() if pulse is not None}

    def _shows_error(self, instance: InstanceSnapshot) -> bool:
        return instance.outputs.error or "error" in self._pulses(instance)

    def _measure(self) -> ListColumns:
        shown, roomy = self._view_model.instances, self.line_width >= ROOMY
        if 0 < self.line_width < NARROW_WIDTH:
            return ListColumns(min(max((measure(i.name) for i in shown), default=8), 12), 0, 4, 0, 0, False)
        name = min(max((measure(instance.name) for instance in shown), default=8), 24 if roomy else 12)
        # 86 columns are for STATUS, lamps, bar, numbers and age; the partner gets the rest.
        room = max(24, self.line_width - name - 86) if roomy else 23
        # Without any connection, the condition gets the partner's columns.
        spare = 13 if not any(self._view_model.connection_of(instance) for instance in shown) else 0
        both = roomy and self._partner_width(True) <= room
        partner = min(self._partner_width(both), room)
        numbers = max((len(_format_bytes(instance)) for instance in shown), default=0)
        return (
            ListColumns(name, partner, 7, 18 + spare, BAR_WIDTH, both, numbers)
            if roomy
            else ListColumns(name, partner, 4, 18 + min(1, spare), 0, both)
        )

    def _partner_width(self, both: bool) -> int:
        links = {instance.connect: instance for instance in self._view_model.instances}  # one each is enough
        partners = (
            _partner(self._view_model.connection_of(instance), both) + self._security_part(name)[0]
            for name, instance in links.items()
        )
        return max(map(len, partners), default=20)

    def _row(self, instance: InstanceSnapshot, columns: ListColumns) -> Row:
        selected = instance.name == self._view_model.selected
        style = self.cursor_style(selected)
        connection = self._view_model.connection_of(instance)
        parts: list[Part] = [
            ("▸" if selected else " ", "key"),
            (SHADOW_SIGN if instance.name in self._view_model.shadows else " ", "dim"),
            (pad(clip_middle(instance.name, columns.name), columns.name) + " ", "strong"),
            *self._partner(connection, columns),
            *_status(instance, self._describe_condition(instance), columns),
            *self._lamps(instance),
            *self._progress(instance, columns),
        ]
        return row(*parts, style=style)

    def _security_part(self, connect: str) -> Part:
        """Return ` TLS` for a secure connection, or ` TLS!` if it accepts any certificate."""
        found = security_of(self._view_model.project.connect(connect))
        if found is None:
            return "", ""
        return (f" {TLS_TEXT}!", "error strong") if found.is_unsafe else (f" {TLS_TEXT}", "dim")

    def _partner(self, connection: ConnectionSnapshot | None, columns: ListColumns) -> list[Part]:
        width, text = columns.partner, _partner(connection, columns.both)
        mark, style = self._security_part(connection.name) if connection and width else ("", "")
        if connection is not None and mark and measure(text) + len(mark) > width:  # then only the port
            text = text.replace(connection.local.partition(":")[0] + ":", ":")
        text = clip(text, width - len(mark))
        gap = " " * (width - measure(text) - len(mark) + 2 * bool(width))
        return [(text, "dim"), (mark, style), (gap, "")]

    def _lamps(self, instance: InstanceSnapshot) -> list[Part]:
        pulses = self._pulses(instance)
        return [
            _lamp("B", instance.outputs.busy, "busy", False),
            _lamp("D", instance.outputs.done, "done", "done" in pulses),
            _lamp("E", instance.outputs.error, "error", "error" in pulses),
        ]

    def _progress(self, instance: InstanceSnapshot, columns: ListColumns) -> list[Part]:
        pulses = self._pulses(instance)
        style = max(pulses, key=lambda style: pulses[style].scan, default="")
        scan = f"scan {pulses[style].scan}" if style else ""
        if not columns.bar:
            have = f" {instance.have}/{instance.need}" if instance.need else ""
            return [(have, ""), (f" {scan}" * (self.line_width >= MIDDLE_WIDTH), style)]
        parts: list[Part] = [(" " * (2 + BAR_WIDTH + columns.numbers), "")]
        if instance.need:
            full, empty = bar(instance.have, instance.need, BAR_WIDTH)
            parts = [
                ("  ", ""),
                (full, "busy"),
                (empty, "faint"),
                (_format_bytes(instance).ljust(columns.numbers), ""),
            ]
        if scan:
            return [*parts, (f"  {scan}", style)]
        last = instance.last_receive_ns
        return [
            *parts,
            (f"  last byte {age_text(self._view_model.t_ns - last)} ago" if last is not None else "", "dim"),
        ]

    # -- choosing -----------------------------------------------------------------------------------

    def action_move(self, rows: int) -> None:
        names = [instance.name for instance in self._listed]
        if not names:
            return
        if self._view_model.selected not in names:  # the filter hides it
            self._choose(0)
            return
        here = names.index(self._view_model.selected)
        self._choose(max(0, min(len(names) - 1, here + rows)))

    def action_next_error(self) -> None:
        """Select the next instance that shows an ERROR, else the next one that has had an ERROR."""
        names = [instance.name for instance in self._listed]
        here = names.index(self._view_model.selected) if self._view_model.selected in names else -1
        order = [*range(here + 1, len(names)), *range(here + 1)]
        for found in (self._shows_error, _has_had_an_error):
            for y in order:
                if found(self._listed[y]):
                    self._choose(y)
                    return

    def click(self, x: int, y: int) -> None:
        if y < len(self._listed):
            self._choose(y)

    def choose_first(self) -> None:
        """Select the first listed instance if the filter hides the selected one."""
        if self._listed and self._view_model.selected not in {each.name for each in self._listed}:
            self._choose(0)

    def _choose(self, y: int) -> None:
        self._view_model.selected = self._listed[y].name
        self.keep_in_view(y)
        self.show()
        self._selected()


def _has_had_an_error(instance: InstanceSnapshot) -> bool:
    return instance.last_error_scan is not None and not instance.last_is_expected


def _format_bytes(instance: InstanceSnapshot) -> str:
    return f" {instance.have}/{instance.need} B" if instance.need else ""


def _lamp(letter: str, on: bool, style: str, glowing: bool) -> Part:
    return f"{letter}{lamp(on, glowing)} ", style if on or glowing else "faint"


def _status(instance: InstanceSnapshot, condition: str, columns: ListColumns) -> list[Part]:
    style = instance.outputs.lit_lamp
    word = status_word(instance.outputs.status)[-columns.word :]
    return [
        (word + " ", style),
        (clip(condition, columns.condition).ljust(columns.condition + 1) * bool(columns.condition), style),
    ]


def _partner(connection: ConnectionSnapshot | None, both: bool) -> str:
    """Return both ends, as `passive 127.0.0.1:2000 ← 127.0.0.1:51322`, or one, as `← 127.0.0.1:51322`."""
    if connection is None:
        return ""
    if connection.udp:
        remote = connection.remote or "no partner"
        return f"UDP     {connection.local} ↔ {remote}" if both else f"↔ {remote}"
    connected = connection.state == "connected"
    if connection.active:
        return f"active  → {connection.remote}" if both else f"→ {connection.remote}"
    if connected:
        return f"passive {connection.local} ← {connection.remote}" if both else f"← {connection.remote}"
    return f"passive {connection.local} ← no partner" if both else f"← waits {connection.local}"
