"""Runs a project for three seconds on the simulated network before a real run, and finds its ERRORs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.table import block_row
from trcvtui.commands.table import parse_script
from trcvtui.commands.words import SetInputs
from trcvtui.diagnosis.block_symptoms import BlockSymptoms
from trcvtui.diagnosis.symptoms import LINK_ERRORS
from trcvtui.snapshots.doctor import Finding
from trcvtui.wording import SECOND

if TYPE_CHECKING:
    from trcvtui.project.project import Project

RUN_NS: Final = 3 * SECOND
CONNECTED_NS: Final = SECOND  # by then all possible connections exist: EN_R rises
IGNORED: Final = frozenset({Condition.NOT_CONNECTED, Condition.STILL_ASKED})  # the doctor sets EN_R


def find_errors(project: Project) -> tuple[Finding, ...]:
    """Return each ERROR that the blocks show while CONT and EN_R are 1, or raise UserError.

    An ERROR of the link counts only if the partner is in the project, as nothing else is on this network.
    """
    bench = Bench(project, "sim")
    symptoms, seq = BlockSymptoms(bench, 0), 0
    try:
        for step in parse_script(project.start, project, f"{project.path}: start"):
            bench.do(step.command)
        _set_pin(bench, "CONT", [each.name for each in project.instances])
        builders = [
            each for each in project.instances if block_row(each.block).runs_as is Condition.ESTABLISHING
        ]
        _set_pin(bench, "REQ", [each.name for each in builders])
        alone = _list_sole_receivers(project)
        while bench.now < RUN_NS:
            if alone and bench.now >= CONNECTED_NS:
                _set_pin(bench, "EN_R", alone)
                alone = []
            bench.step()
            news, seq = bench.runtime.ledger.events_since(seq), bench.runtime.ledger.last_seq
            for scan, t_ns, event in news:
                symptoms.add_event(scan, t_ns, event)
        found = symptoms.list_findings(is_running=False)
    finally:
        bench.close()
    partners: set[object] = {each.end for each in project.peers}
    return tuple([one for one in found if _is_counted(one, project, partners)])


def _set_pin(bench: Bench, pin: str, names: list[str]) -> None:
    for name in names:
        shown = bench.runtime.snapshot().instance(name)
        if shown is not None and pin in dict(shown.inputs):
            bench.do(SetInputs(name, ((pin, True),)))


def _list_sole_receivers(project: Project) -> list[str]:
    """Return the receivers that are alone on their CONNECT: several on one CONNECT could work in turn."""
    some = [each for each in project.instances if block_row(each.block).receives_on_net]
    return [each.name for each in some if sum(one.connect == each.connect for one in some) == 1]


def _is_counted(one: Finding, project: Project, partners: set[object]) -> bool:
    if not one.leads_to or one.leads_to[0] in IGNORED:
        return False
    config = project.connect(one.connect)
    has_partner = config is not None and (
        f"@{config.name}" in partners or str(config.remote_port).startswith("@")
    )
    return one.leads_to[0] not in LINK_ERRORS or has_partner
