"""Pane 3: the STATUS word, what it means, why it is shown now, and what to check next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from trcvtui.plc.ledger import Line, StatusEdge
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.project.connect_view import WARNING, security_of
from trcvtui.tui.formatting import GLOW, cells, lamp, moment, plain, status_word, wrapped
from trcvtui.tui.view_model.explain import Explainer
from trcvtui.tui.view_model.view_model import DONE, ERROR, ViewModel
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row

if TYPE_CHECKING:
    from trcvtui.rig.diagnosis.advice import Advice
    from trcvtui.rig.diagnosis.data_view import Offer

LABEL: Final = 6


class StatusCard(LineView):
    """The STATUS of the selected instance, or of an edge of its past that the history points at."""

    def keys(self) -> tuple[tuple[str, str], ...]:
        """Return the way back to now, while an edge of the past is explained."""
        return (("esc", "now"),) if self._past is not None else ()

    def __init__(self, scene: ViewModel, digit: int = 3) -> None:
        super().__init__(id="status")
        self._digit = digit
        self._scene = scene
        self._explainer = Explainer(scene)
        self._past: Line | None = None
        self._rows: list[Row] = []
        self._whole = 0

    def offer(self) -> Offer | None:
        """Return the layout in which DATA would take what came, None where nothing speaks for one."""
        return self._explainer.offer()

    @property
    def least_rows(self) -> int:
        """Return the lines from the STATUS word to the last `next`: less would cut the advice."""
        return self._whole

    def point_at(self, line: Line | None) -> None:
        """Explain this edge of the past; None: the present."""
        self._past = line
        self.show()

    def show(self) -> None:
        """Repaint what changed."""
        self.set_title(self._digit, "STATUS", f"scan {self._past.scan}, in the past" if self._past else "")
        self._whole = 0
        self._rows = self._card()
        self._whole = self._whole or len(self._rows)
        super().show()

    def row_count(self) -> int:
        """Return the number of lines of the card."""
        return len(self._rows)

    def row_at(self, y: int) -> Row:
        """Return one line of the card."""
        return self._rows[y] if y < len(self._rows) else EMPTY

    def _card(self) -> list[Row]:
        instance = self._scene.instance
        if instance is None:
            return self._nothing()
        if self._past is not None and isinstance(edge := self._past.event, StatusEdge):
            when = f"in scan {self._past.scan}, at {moment(self._past.t_ns)} s"
            return self._rows_for(edge, when, self._explainer.then(self._past, edge), [])
        told = self._explainer.now(instance)
        when = f"since scan {instance.since_scan}"
        return self._rows_for(instance, when, told, self._lamps(instance), self._warnings(instance))

    def _warnings(self, instance: InstanceSnapshot) -> Sequence[str]:
        """Return what will go wrong with the framing of a block on a ComBuffer."""
        if instance.framer is None or self._scene.snapshot is None:
            return ()
        from trcvtui.rig.diagnosis.serial import warnings_of  # read when the first framer is here

        return warnings_of(self._scene.snapshot, self._scene.project, instance.name)

    def _nothing(self) -> list[Row]:
        if self._scene.project.instances or self._scene.picture is None:
            return [row(("waiting for the first scan", "dim"))]
        texts = (
            "no instance is on this bench",
            "next  press A, then enter: TRCV_C_1 with a CONNECT at 127.0.0.1 and its DATA",
            "then  t raises CONT: it listens. n raises EN_R: it receives. Who then sends makes a DONE",
        )
        width = max(20, self.line_width)
        return [row((line, "dim")) for text in texts for line in wrapped(text, width)]

    def _rows_for(
        self,
        shown: InstanceSnapshot | StatusEdge,
        when: str,
        told: Advice,
        lamps: list[Part],
        warnings: Sequence[str] = (),
    ) -> list[Row]:
        found = self._scene.project.dialect.row(shown.outputs.status, shown.block)
        title = found.title if found else shown.condition
        style = shown.outputs.lit or "strong"
        flag = "ERROR  " if shown.outputs.error else ""
        head: list[Part] = [
            (f"{status_word(shown.outputs.status)}  ", style),
            (flag, "error"),
            (title, style),
        ]
        fits = sum(cells(text) for text, _ in head) + 2 + len(when) <= self.line_width
        rows = [row(*head, (f"  {when}", "dim"))] if fits else [row(*head), row((when, "dim"))]
        if sum(len(text) for text, _ in lamps) > self.line_width:
            lamps, rest = lamps[:-1], lamps[-1:]
            rows += [row(*lamps), row(*rest)]
        elif lamps:
            rows.append(row(*lamps))
        rows += self._paragraph("warn", warnings, "warn")
        rows += self._paragraph("TLS", self._unsafe(shown), "error strong")
        rows += self._paragraph("why", [told.why], "warn" if shown.cause.injected else "")
        rows += self._paragraph("next", told.checks, "strong")
        self._whole = len(rows)
        label = "else" if told.checks else "next"
        if told.code is not None:  # the last attempt's row says more than "connecting"
            found = self._scene.project.dialect.row(told.code, shown.block) or found
            label = f"{told.code:04X}"
        if found is not None:
            rows += self._paragraph(label, found.checks_of(shown.block), "dim")
            rows += self._paragraph("means", found.causes_of(shown.block), "dim")
        return rows

    def _unsafe(self, shown: InstanceSnapshot | StatusEdge) -> list[str]:
        project = self._scene.project
        name = shown.name if isinstance(shown, InstanceSnapshot) else shown.instance
        decl = project.instance(name)
        found = security_of(project.connect(decl.connect)) if decl is not None else None
        return [WARNING] if found is not None and found.is_unsafe else []

    def _paragraph(self, label: str, texts: Sequence[str], style: str) -> list[Row]:
        rows: list[Row] = []
        for text in texts:
            mark = "· " if len(texts) > 1 else ""
            for number, line in enumerate(wrapped(text, self.line_width - LABEL - len(mark))):
                shown = label if not rows else ""
                lead = mark if number == 0 else " " * len(mark)
                rows.append(row((shown.ljust(LABEL), "label"), (lead + line, style)))
        return rows

    def _lamps(self, instance: InstanceSnapshot) -> list[Part]:
        glow, now = self._scene.afterglow.glow, self._scene.t_ns
        outputs = instance.outputs
        parts: list[Part] = [(f"BUSY {lamp(outputs.busy)}   ", "busy" if outputs.busy else "faint")]
        for name, on, style in ((DONE, outputs.done, "done"), (ERROR, outputs.error, "error")):
            pulse = glow(instance.name, name, now)
            if on or pulse is None:
                parts.append((f"{name} {lamp(on)}   ", style if on else "faint"))
                continue
            what = f" {pulse.rcvd_len} B" if pulse.rcvd_len else ""
            what = f" {status_word(pulse.status)}" if name == ERROR and pulse.status else what
            parts.append((f"{name} {GLOW}{what} in scan {pulse.scan}   ", "glow"))
        if (
            instance.last_error_status is not None
            and not instance.outputs.error
            and not glow(instance.name, ERROR, now)
        ):
            last = f"last error {status_word(instance.last_error_status)} in scan {instance.last_error_scan}"
            parts.append((plain(last), "dim"))
        return parts
