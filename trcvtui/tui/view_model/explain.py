"""Explains the present or a past STATUS of a block: collects the evidence and asks the rules."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from trcvtui.diagnosis.advice import Advice, describe_cause, make_advice
from trcvtui.diagnosis.evidence import Evidence, make_current_evidence, make_past_evidence
from trcvtui.diagnosis.job import SuggestedAction
from trcvtui.diagnosis.status_card import CardBuilder, DataContent
from trcvtui.plc.ledger import Line, StatusEdge
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.tui.view_model.view_model import ViewModel

if TYPE_CHECKING:
    from trcvtui.diagnosis.data_view import LayoutOffer


NO_TRIAL: Final = re.compile(r"pulse \w+ COM_RST|set \w+ (CONT|EN_R|REQ)=[01]")  # these change no job


def explain_status(shown: StatusEdge | InstanceSnapshot) -> str:
    """Return the evidence of a STATUS: what happened, call, error, partner, injected or not."""
    return "expected: " * shown.cause.is_expected + describe_cause(shown.cause, shown.block)


class StatusExplainer:
    """Explains the selected instance now, or at a past edge, and stores the last explanations."""

    def __init__(self, view_model: ViewModel) -> None:
        self._view_model = view_model
        self._edge: tuple[int, int, Advice] | None = None  # bench, line
        self._card = CardBuilder()

    def explain_now(self, instance: InstanceSnapshot) -> Advice:
        """Return what is known of an instance after the last scan."""
        evidence = self._evidence(instance.name)
        if evidence is None:
            return Advice(explain_status(instance), ())
        index = self._view_model.stream_index
        card = self._card.build_advice(
            evidence, instance, index, self._data_content, "press `V` to read DATA with"
        )
        verdict, remedy = self._doctor_verdict(instance.name)
        return replace(card, causes=(verdict, *card.causes), do=(remedy, *card.do)) if verdict else card

    def _doctor_verdict(self, name: str) -> tuple[str, SuggestedAction]:
        """Return the doctor's first finding and remedy, "" if the doctor has not run or found nothing."""
        picture = self._view_model.picture
        if picture is None or not picture.doctor.findings:
            return "", SuggestedAction("")
        from trcvtui.bench.doctor_requests import findings_of  # imported once the doctor has findings

        for one in findings_of(name, picture.doctor.findings, self._view_model.project):
            remedy = f"{one.mend[0].text}. " if one.mend else ""
            sure = f"{one.confidence:.0%} sure up to scan {picture.doctor.scan}"
            steps = [mend for mend in one.mend if mend.tried] or [*one.mend[:1]]
            # The trial was of all steps: if one has no bench line, the others alone may do harm.
            is_whole = all(mend.command or mend.set for mend in steps)
            lines = tuple([mend.command for mend in steps if mend.command and is_whole])
            needs_trial = not all(mend.tried for mend in steps) and not all(map(NO_TRIAL.fullmatch, lines))
            do = SuggestedAction(f"{remedy}`J` shows the evidence", lines, needs_trial)
            return f"{one.title} ({one.cause}, {sure})", do
        return "", SuggestedAction("")

    def layout_offer(self) -> LayoutOffer | None:
        """Return the layout of DATA that fits the received bytes; None if there is no evidence."""
        instance = self._view_model.instance
        evidence = self._evidence(instance.name) if instance else None
        index = self._view_model.stream_index
        return self._card.find_offer(evidence, self._data_content, index) if evidence is not None else None

    def _evidence(self, name: str) -> Evidence | None:
        picture = self._view_model.picture
        return make_current_evidence(picture, self._view_model.project, name) if picture else None

    @property
    def _data_content(self) -> DataContent:
        view_model = self._view_model
        return DataContent(view_model.declaration, view_model.data, view_model.job_bytes)

    def explain_edge(self, line: Line, edge: StatusEdge) -> Advice:
        """Explain a past edge from the ledger, but the newest edge as the present: it still holds."""
        edges, instance = self._view_model.history.list_edges(edge.instance), self._view_model.instance
        if instance is not None and edges and edges[-1].seq == line.seq:
            return self.explain_now(instance)
        key = self._view_model.bench, line.seq
        if self._edge is None or self._edge[:2] != key:
            self._edge = (*key, self._explain_past(line, edge))
        return self._edge[2]

    def _explain_past(self, line: Line, edge: StatusEdge) -> Advice:
        from trcvtui.history.link_statistics import past_facts  # imported with the first past edge

        project = self._view_model.project
        decl = project.instance(edge.instance)
        facts, until = past_facts(self._view_model.lines, line, edge, decl.connect if decl else "")
        return make_advice(make_past_evidence(line, edge, facts, until, project, self._interval_ns))

    @property
    def _interval_ns(self) -> int:
        return self._view_model.snapshot.interval_ns if self._view_model.snapshot else 0
