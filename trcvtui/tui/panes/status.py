"""Pane 3: the STATUS, its cause and what to check next. Pane 4: all earlier changes of the STATUS."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from itertools import takewhile, zip_longest
from typing import TYPE_CHECKING, ClassVar, Final

from trcvtui.diagnosis.link import describe_condition
from trcvtui.plc.ledger import Line, Outputs, StatusEdge
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.project.connect_view import UNVERIFIED_WARNING, security_of
from trcvtui.tui.formatting import GLOW_SIGN, ON_SIGN, clip, lamp, measure, status_word, wrap_text
from trcvtui.tui.messages import EdgeSelected, ScreenCallbacks
from trcvtui.tui.view_model.explain import StatusExplainer, explain_status
from trcvtui.tui.view_model.view_model import DONE, ERROR, ViewModel
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, TextView, row
from trcvtui.wording import stamp_text

WORD_WIDTH: Final = 14  # at least; a long condition makes it wider
LAMP_WIDTH: Final = 7
LEAST_CONDITION_WIDTH, MOST_CONDITION_WIDTH = 19, 32  # columns; `waiting for a frame` is never cut
CURSOR_SIGN: Final = "▸"
HISTORY_DIGIT: Final = 4  # of the bench
LEAST_REASON_WIDTH: Final = 10  # characters; less would say nothing


class StatusHistory(LineView):
    """The STATUS edges of the selected instance. A chosen edge stays chosen while newer edges come in."""

    KEYS: ClassVar = (("↑↓", "explain"), ("!", "ERROR"), ("/", "code"), ("n N", "more"), ("esc", "now"))
    BINDINGS: ClassVar = [
        ("exclamation_mark", "error_before", "the ERROR before"),
        ("slash", "ask_code", "find a code"),
        ("n", "hit(1)", "the edge before with the code of /, else the ERROR before"),
        ("N", "hit(-1)", "the next edge with the code of /, else the next ERROR"),
        ("escape", "now", "back to now"),
    ]

    def __init__(self, view_model: ViewModel, actions: ScreenCallbacks, digit: int = HISTORY_DIGIT) -> None:
        super().__init__(id="history")
        self._digit, self._view_model, self._actions = digit, view_model, actions
        self._edges: list[Line] = []
        self._chosen: int | None = None
        self._longest, self._lamp = WORD_WIDTH, LAMP_WIDTH
        self.code: int | None = None  # that `find` searches, until escape

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """On the scenarios screen, leave the key n to that screen, where n runs the next step."""
        return action != "hit" or self._digit == HISTORY_DIGIT

    def show(self) -> None:
        """Repaint the changed rows; a view scrolled into the past keeps showing the same edges."""
        before = self._edges[0].seq if self._edges else 0
        self._edges = list(reversed(self._view_model.history.list_edges(self._view_model.selected)))
        self._widen_columns(before)
        self.set_title(self._digit, "History", self._describe_skipped())
        if self.scroll_offset.y:
            fresh = sum(1 for line in self._edges[:64] if line.seq > before) if before else 0
            self.apply_row_count()
            if fresh:
                self.scroll_to(y=self.scroll_offset.y + fresh, animate=False)
        super().show()

    def _widen_columns(self, known: int) -> None:
        fresh = [line.event for line in takewhile(lambda line: line.seq > known, self._edges)]
        kinds = {(e.condition, e.outputs): e for e in fresh if isinstance(e, StatusEdge)}  # few differ
        for edge in kinds.values():
            self._longest = max(self._longest, len(self._label(edge, MOST_CONDITION_WIDTH)))
            self._lamp = max(self._lamp, len(_lamp_text(edge)))

    def _describe_skipped(self) -> str:
        skipped = self._view_model.history.skipped
        return f"{skipped} lines came too fast for this list" if skipped else ""

    def _label(self, edge: StatusEdge, width: int) -> str:
        condition = describe_condition(self._view_model.project, edge.instance, edge)
        return f"{status_word(edge.outputs.status)} {clip(condition, width)}"

    @property
    def _word_width(self) -> int:
        return min(self._longest, len(status_word(0)) + 1 + self._condition_width())

    def _condition_width(self) -> int:
        return max(LEAST_CONDITION_WIDTH, min(MOST_CONDITION_WIDTH, self.line_width - 65))

    def row_count(self) -> int:
        return len(self._edges) + 1

    def row_at(self, y: int) -> Row:
        if y == 0:
            return self._head()
        line = self._edges[y - 1]
        if not isinstance(line.event, StatusEdge):
            return EMPTY
        return row(*self._edge(line, line.event), style="cursor" if line.seq == self._chosen else "")

    def _widths(self) -> tuple[int, int]:
        newest = self._edges[0] if self._edges else None
        if newest is None:
            return 5, 7
        return max(5, len(str(newest.scan))), max(7, len(stamp_text(newest.t_ns)))

    def _head(self) -> Row:
        scan, time = self._widths()
        why = "why" if self._reason_width() >= LEAST_REASON_WIDTH else ""
        outputs = f"{'STATUS':<{self._word_width}}  {'lamp':<{self._lamp}}"
        return row((f" {'scan':>{scan}}  {'t in s':>{time}}  {outputs}  {why}", "dim"))

    def _reason_width(self) -> int:
        return self.line_width - sum(self._widths()) - self._word_width - self._lamp - 9

    def _edge(self, line: Line, edge: StatusEdge) -> list[Part]:
        scan, time = self._widths()
        style = "dim" if edge.cause.is_expected else edge.outputs.lit_lamp
        room = self._reason_width()
        reason = clip(explain_status(edge), room) if room >= LEAST_REASON_WIDTH else ""
        return [
            (CURSOR_SIGN if line.seq == self._chosen else " ", "key"),
            (f"{line.scan:>{scan}}  {stamp_text(line.t_ns):>{time}}  ", "dim"),
            (self._label(edge, self._condition_width()).ljust(self._word_width + 2), style),
            (_lamp_text(edge).ljust(self._lamp + 2), style),
            (reason, "warn" if edge.cause.injected else "dim"),
        ]

    # -- choosing -----------------------------------------------------------------------------------

    def action_move(self, rows: int) -> None:
        here = next((y for y, line in enumerate(self._edges) if line.seq == self._chosen), -1)
        self._choose(min(len(self._edges) - 1, here + rows))

    def action_error_before(self) -> None:
        """Choose the next older ERROR; after the oldest comes the newest."""
        self._choose_where(lambda outputs: outputs.error, "ERROR", 1)

    def action_hit(self, step: int) -> None:
        """Choose the next older (`step` 1) or newer (-1) edge with the sought code; if none, an ERROR."""
        code = self.code
        what = "ERROR" if code is None else f"{code:04X}"
        self._choose_where(lambda out: out.error if code is None else out.status == code, what, step)

    def _choose_where(self, holds: Callable[[Outputs], bool], what: str, step: int) -> None:
        edges = [(y, line.event) for y, line in enumerate(self._edges)][::step]
        here = next((y for y, line in enumerate(self._edges) if line.seq == self._chosen), -1)
        found = [y for y, edge in edges if isinstance(edge, StatusEdge) and holds(edge.outputs)]
        if found:
            self._choose(next((y for y in found if (y - here) * step > 0), found[0]))  # in a circle
        else:
            self._actions.complain(f"no {what} in the known history of {self._view_model.selected}")

    def action_ask_code(self) -> None:
        self._actions.open_prompt("find ")

    def action_now(self) -> None:
        self.code = None
        self._choose(-1)

    def click(self, x: int, y: int) -> None:
        self._choose(y - 1)

    def _choose(self, y: int) -> None:
        self._chosen = self._edges[y].seq if y >= 0 else None
        self.apply_row_count()
        self.keep_in_view(y + 1 if y >= 0 else 0)
        self.post_message(EdgeSelected(self._chosen, self.find_chosen_line()))
        self.show()

    def choose_edge(self, seq: int | None) -> None:
        """Choose the edge that another pane chose. If this list does not have that edge, choose none."""
        if seq == self._chosen:
            return
        y = next((y for y, line in enumerate(self._edges) if line.seq == seq), -1)
        self._chosen = seq if y >= 0 else None
        self.keep_in_view(y + 1 if y >= 0 else 0)
        self.show()

    def clear_history(self) -> None:
        self._chosen = self.code = None
        self._edges, self._longest, self._lamp = [], WORD_WIDTH, LAMP_WIDTH
        self.scroll_to(y=0, animate=False)

    def find_chosen_line(self) -> Line | None:
        return next((line for line in self._edges if line.seq == self._chosen), None)


def _lamp_text(edge: StatusEdge) -> str:
    out = edge.outputs
    size = f" {out.rcvd_len} B" if out.rcvd_len is not None else ""
    ends = [f"DONE{size}"] * out.done + ["ERROR"] * out.error  # both: a frame without an end within its size
    lit = ends or ["BUSY"] * out.busy
    return f"{ON_SIGN} {', '.join(lit)}" if lit else ""


if TYPE_CHECKING:
    from trcvtui.diagnosis.advice import Advice
    from trcvtui.diagnosis.data_view import LayoutOffer
    from trcvtui.diagnosis.job import SuggestedAction

LABEL_WIDTH: Final = 7
BENCH_STATUS_DIGIT: Final = 3  # the scenario screen has another digit and no pane 5
KEY_MARK: Final = "`"  # around keys and commands: they get the accent colour, the mark is not drawn
PIN_COMMAND: Final = re.compile(r"(?:pulse|set) (\S+) (\w+)(=\w+)?")
FIRST_WORD: Final = re.compile(r"[a-z]+(?=[ ,:])(?! gave )(?! is )")  # a plain word: no name, no call


class StatusCard(TextView):
    """The STATUS of the selected instance, now or at the chosen edge of the past."""

    BINDINGS: ClassVar = [("enter", "remedy", "type what `do` says")]

    def keys(self) -> tuple[tuple[str, str], ...]:
        messages = (("D", "messages"),) if self._digit == BENCH_STATUS_DIGIT else ()
        if self._past is not None:
            return (*messages, ("esc", "now"))
        has_lines = any(do.lines for do in self._do) and not self._sends_nothing
        return ((("enter", "do"),) if has_lines else ()) + messages

    @property
    def _sends_nothing(self) -> bool:
        is_bench = self._digit == BENCH_STATUS_DIGIT and self._view_model.position is None
        return not is_bench or getattr(self.app, "only_looks", False)

    def __init__(
        self,
        view_model: ViewModel,
        actions: ScreenCallbacks,
        digit: int = 3,
        letter_of: Callable[[str], str] = lambda pin: "",
    ) -> None:
        """`letter_of` returns the key that changes a pin of the selected instance, or ""."""
        super().__init__(id="status")
        self._letter_of, self._digit, self._view_model, self._actions = letter_of, digit, view_model, actions
        self._explainer = StatusExplainer(view_model)
        self._past: Line | None = None
        self._do: tuple[SuggestedAction, ...] = ()
        self._do_rows = range(0)

    def _remedy_lines(self) -> tuple[str, ...]:
        """Return the bench commands of the first remedy that is not done yet and needs no trial."""
        instance = self._view_model.instance
        if instance is None or self._past is not None:
            return ()
        done = [f"set {instance.name} {pin}={int(value)}" for pin, value in instance.inputs]
        some = (do.lines for do in self._do if do.lines and not do.needs_trial)
        return next((lines for lines in some if lines[0] not in done), ())

    def propose_value(self, pin: str) -> str:
        """Return the value that the remedy proposes for a number pin, or ""."""
        begin = f"set {self._view_model.selected} {pin}="
        return next((line.removeprefix(begin) for line in self._remedy_lines() if line.startswith(begin)), "")

    def action_remedy(self) -> None:
        """Open the prompt with the bench commands of the remedy, or say why there is no command."""
        untried = [line for do in self._do if do.needs_trial for line in do.lines]
        if self._sends_nothing:
            self._actions.complain("`do` is only text here: this screen sends no commands")
        elif self._past is not None:
            self._actions.complain("this is the past: esc goes back to now, where `do` has advice")
        elif lines := self._remedy_lines():
            self._actions.open_prompt(*lines)
        else:
            wrong = "`do` has no bench command to type"
            self._actions.complain(f"{untried[0]} was not tried: J tries it" if untried else wrong)

    def click(self, x: int, y: int) -> None:
        if y in self._do_rows:
            self.action_remedy()

    def layout_offer(self) -> LayoutOffer | None:
        return self._explainer.layout_offer()

    def explain_at(self, line: Line | None) -> None:
        """Explain the STATUS at this edge of the past, or the present STATUS if `line` is None."""
        self._past = line
        self.show()

    def show(self) -> None:
        self.set_title(self._digit, "STATUS", f"scan {self._past.scan}, in the past" if self._past else "")
        self._do, self._do_rows = (), range(0)
        self._rows = self._card()
        super().show()

    def _card(self) -> list[Row]:
        instance = self._view_model.instance
        if instance is None:
            return self._no_instance_rows()
        if self._past is not None and isinstance(edge := self._past.event, StatusEdge):
            when = f"in scan {self._past.scan}, at {stamp_text(self._past.t_ns)} s"
            return self._rows_for(edge, when, self._explainer.explain_edge(self._past, edge), [])
        advice = self._explainer.explain_now(instance)
        when = f"since scan {instance.since_scan}"
        return self._rows_for(instance, when, advice, self._lamps(instance), self._warnings(instance))

    def _warnings(self, instance: InstanceSnapshot) -> Sequence[str]:
        if instance.framer is None or self._view_model.snapshot is None:
            return ()
        from trcvtui.diagnosis.serial import list_framing_warnings  # imported with the first framer

        return list_framing_warnings(self._view_model.snapshot, self._view_model.project, instance.name)

    def _no_instance_rows(self) -> list[Row]:
        if self._view_model.project.instances or self._view_model.picture is None:
            return [row(("waiting for the first scan", "dim"))]
        texts = (
            "press `A`, then `enter`: you get TRCV_C_1 with a CONNECT at 127.0.0.1 and its DATA",
            "`t` raises CONT: it listens. `n` raises EN_R: it receives. A whole DATA makes a DONE",
        )
        return [row(("this bench has no instance", "strong")), *self._paragraph("do", texts, "")]

    def _rows_for(
        self,
        shown: InstanceSnapshot | StatusEdge,
        when: str,
        advice: Advice,
        lamps: list[Part],
        warnings: Sequence[str] = (),
    ) -> list[Row]:
        found = self._view_model.project.dialect.row(shown.outputs.status, shown.block)
        title = found.title if found else shown.condition
        style = shown.outputs.lit_lamp or "strong"
        flag = "ERROR  " if shown.outputs.error else ""
        head: list[Part] = [
            (f"{status_word(shown.outputs.status)}  ", style),
            (flag, "error"),
            (title, style),
        ]
        fits = sum(measure(text) for text, _ in head) + 2 + len(when) <= self.line_width
        rows = [row(*head, (f"  {when}", "dim"))] if fits else [row(*head), row((when, "dim"))]
        if sum(len(text) for text, _ in lamps) > self.line_width:
            lamps, rest = lamps[:-1], lamps[-1:]
            rows += [row(*lamps), row(*rest)]
        elif lamps:
            rows.append(row(*lamps))
        rows += self._paragraph("warn", warnings, "warn")
        rows += self._paragraph("TLS", self._list_tls_warnings(shown), "error strong")
        is_error = shown.outputs.error
        # An ERROR: its cause first. Else: proven causes, then what the block waits for.
        why, causes = advice.why, advice.causes
        reasons = tuple(dict.fromkeys((why, *causes) if is_error else (*causes, why)))
        style = "warn" if shown.cause.injected else ""
        rows += self._paragraph("why", reasons, style or ("strong" if causes or is_error else ""), style)
        rows += self._paragraph("note", self._list_notes(shown), "dim")
        self._do, first = advice.do, len(rows)
        rows += self._paragraph("do", [self._with_keys(do) for do in advice.do], "")
        self._do_rows = range(first, len(rows))
        if advice.code is not None:  # the last attempt's row says more than "connecting"
            found = self._view_model.project.dialect.row(advice.code, shown.block) or found
        if found is not None:
            rows += self._paragraph("check", found.checks_of(shown.block), "dim")
            rows += self._paragraph("usually means", found.causes_of(shown.block), "dim")
        return rows

    def _list_notes(self, shown: InstanceSnapshot | StatusEdge) -> list[str]:
        link = self._view_model.connection
        if isinstance(shown, StatusEdge) or not shown.last_is_expected or link is None or link.incarnation:
            return []
        code = status_word(shown.last_error_status or 0)
        return [f"{code} expected: EN_R came before the connection; once that is up, it receives"]

    def _list_tls_warnings(self, shown: InstanceSnapshot | StatusEdge) -> list[str]:
        project = self._view_model.project
        name = shown.name if isinstance(shown, InstanceSnapshot) else shown.instance
        decl = project.instance(name)
        found = security_of(project.connect(decl.connect)) if decl is not None else None
        return [UNVERIFIED_WARNING] if found is not None and found.is_unsafe else []

    def _paragraph(self, label: str, texts: Sequence[str], *styles: str) -> list[Row]:
        rows: list[Row] = []
        if len(label) >= LABEL_WIDTH and texts:
            rows, label = [row((label, "label"))], ""
        bullet = "· " if len(texts) > 1 else ""
        for text, style in zip_longest(texts, styles[: len(texts)], fillvalue=styles[-1]):
            lead, is_key = label.ljust(LABEL_WIDTH) + bullet, False
            for line in wrap_text(self._sentence(text), self.line_width - len(lead)):
                pieces = [(piece, f"key {style}" if (n % 2 == 1) != is_key else style)
                          for n, piece in enumerate(line.split(KEY_MARK))]  # fmt: skip
                is_key ^= len(pieces) % 2 == 0  # a command may continue on the next line
                rows.append(row((lead[:LABEL_WIDTH], "label"), (lead[LABEL_WIDTH:], style), *pieces))
                lead, label = " " * len(lead), ""
        return rows

    def _sentence(self, text: str) -> str:
        first = FIRST_WORD.match(text)
        if first is not None and first.group() not in self._project_names():
            text = text[:1].upper() + text[1:]
        return text if text.endswith((".", "?", "!", KEY_MARK)) else f"{text}."

    def _with_keys(self, do: SuggestedAction) -> str:
        """Return the text of a suggested action, with a key in place of a command that the key does."""
        text = do.text
        for line in do.lines if self._past is None else ():
            command = PIN_COMMAND.fullmatch(line)
            if (
                command
                and command[1] == self._view_model.selected
                and (letter := self._letter_of(command[2]))
            ):
                text = text.replace(f"`{line}`", f"press `{letter}` ({command[2]}{command[3] or ''})")
        return text

    def _project_names(self) -> set[str]:
        """Return the project's names, whose first letter a sentence must not capitalize."""
        project = self._view_model.project
        peers = [peer.name for peer in project.peers]
        data = [each.name for each in project.data]
        return {*project.links(), *peers, *data, *[each.name for each in project.instances]}

    def _lamps(self, instance: InstanceSnapshot) -> list[Part]:
        glow, now = self._view_model.afterglow.find_pulse, self._view_model.t_ns
        outputs = instance.outputs
        parts: list[Part] = [(f"BUSY {lamp(outputs.busy)}   ", "busy" if outputs.busy else "faint")]
        for name, on, style in ((DONE, outputs.done, "done"), (ERROR, outputs.error, "error")):
            pulse = glow(instance.name, name, now)
            if on or pulse is None:
                parts.append((f"{name} {lamp(on)}   ", style if on else "faint"))
                continue
            what = f" {pulse.rcvd_len} B" if pulse.rcvd_len else ""
            what = f" {status_word(pulse.status)}" if name == ERROR and pulse.status else what
            parts.append((f"{name} {GLOW_SIGN}{what} in scan {pulse.scan}   ", style))
        if (
            instance.last_error_status is not None
            and not instance.last_is_expected
            and not instance.outputs.error
            and not glow(instance.name, ERROR, now)
        ):
            last = f"last error {status_word(instance.last_error_status)} in scan {instance.last_error_scan}"
            parts.append((last, "dim"))
        return parts
