"""The processes of the doctor (diagnosis/judges.py): they run a recording again, as `replay` does."""

from __future__ import annotations

from trcvtui.diagnosis.doctor_process import DoctorInput, JudgedRun
from trcvtui.recording.writer import write_all
from trcvtui.replay.job_facts import recorded_facts
from trcvtui.scenario.scenario import load_bench


def run_main(path: str, asked: str) -> None:
    write_all(asked, lambda _: JudgedRun(path, recorded_facts, load_bench), path)


def files_main(path: str, asked: str) -> None:
    write_all(asked, lambda _: DoctorInput(path, recorded_facts, load_bench), path)
