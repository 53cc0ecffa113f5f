"""Captures judged by several workers: the answers of one process, and no file is lost with a worker."""

from __future__ import annotations

import contextlib
import os
import random
import re
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.diagnosis.doctor_cases import Built, healthy_fixed, resets
from trcvtui.cli.main import main
from trcvtui.diagnosis import workers
from trcvtui.diagnosis.doctor import CaptureAnswer, DoctorQuestion, try_to_judge
from trcvtui.diagnosis.workers import judge_in_cluster, judge_in_processes
from trcvtui.errors import UserError

QUESTION = DoctorQuestion()


def judge_or_die(path: str, asked: DoctorQuestion) -> CaptureAnswer | UserError:
    """Judge; a file named so kills the process that reads it, as one that needs too much memory would."""
    if "deadly" in path:
        os.kill(os.getpid(), signal.SIGKILL)
    return try_to_judge(path, asked)


def captures(folder: Path, count: int) -> list[str]:
    paths = []
    for seed in range(count):
        built = Built("")
        (resets if seed % 2 else healthy_fixed)(random.Random(seed), built)
        path = folder / f"c{seed}.pcapng"
        path.write_bytes(built.file())
        paths.append(str(path))
    return paths


@pytest.mark.slow
def test_a_file_that_kills_its_worker_is_reported_and_no_other_is_lost(tmp_path: Path) -> None:
    deadly = tmp_path / "deadly.pcapng"
    deadly.touch()
    paths = captures(tmp_path, 4)
    paths[1:1] = [str(deadly)]
    answers = dict(judge_in_processes(paths, QUESTION, judge_or_die, 2))
    assert set(answers) == set(paths)
    wrong = answers.pop(str(deadly))
    assert isinstance(wrong, UserError)
    assert wrong.lines() == [f"{deadly}: found 2 workers died of it, expected a capture that can be judged"]
    for path, answer in answers.items():
        assert answer == try_to_judge(path, QUESTION)


# -- a cluster of two workers on this machine ----------------------------------------------------------------


class Cluster:
    """A Dask scheduler and workers, each a process of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.processes = [self._started("scheduler", "--port", "0", "--no-dashboard", "--host", "127.0.0.1")]
        self.address = self._said(self.processes[0], r"tcp://127\.0\.0\.1:\d+")

    def _started(self, *words: str) -> subprocess.Popen[bytes]:
        log = (self._folder / f"{words[0]}{len(getattr(self, 'processes', ()))}.log").open("wb")
        root = str(Path(__file__).parents[2])
        environment = os.environ | {"PYTHONPATH": os.pathsep.join((root, os.environ.get("PYTHONPATH", "")))}
        with log:
            made = subprocess.Popen(
                [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]],
                stdout=log, stderr=log, env=environment, cwd=self._folder,
            )  # fmt: skip
        made.log = Path(log.name)  # type: ignore[attr-defined]
        return made

    @staticmethod
    def _said(process: subprocess.Popen[bytes], what: str) -> str:
        while process.poll() is None:
            found = re.search(what, process.log.read_text())  # type: ignore[attr-defined]
            if found:
                return found[0]
            os.sched_yield()
        raise AssertionError(process.log.read_text())  # type: ignore[attr-defined]

    def work(self, *words: str) -> subprocess.Popen[bytes]:
        """Start one more worker; it has registered."""
        made = self._started(
            "worker", self.address, "--nthreads", "1", "--no-dashboard", "--no-nanny", *words
        )
        self.processes.append(made)
        self._said(made, "Registered to")
        return made

    def close(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    pytest.importorskip("distributed", reason="Dask is not installed: pip install 'trcvtui[cluster]'")
    made = Cluster(tmp_path)
    yield made
    made.close()


@pytest.mark.live
@pytest.mark.slow
def test_a_cluster_gives_the_answers_of_one_process_also_when_a_worker_dies(
    cluster: Cluster, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "captures").mkdir()
    paths = captures(tmp_path / "captures", 12)
    assert main(["doctor", *paths, "--format", "jsonl"]) == 1
    alone = sorted(capsys.readouterr().out.splitlines())
    some = [cluster.work(), cluster.work()]
    assert main(["doctor", *paths, "--format", "jsonl", "--scheduler", cluster.address]) == 1
    assert sorted(capsys.readouterr().out.splitlines()) == alone
    some[0].kill()
    assert main(["doctor", *paths, "--format", "jsonl", "--scheduler", cluster.address]) == 1
    assert sorted(capsys.readouterr().out.splitlines()) == alone


@pytest.mark.live
@pytest.mark.slow
def test_what_no_worker_can_open_is_judged_here(
    cluster: Cluster, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):
        cluster.work()
    gone = str(tmp_path / "nowhere.pcapng")
    (path,) = captures(tmp_path, 1)
    assert main(["doctor", gone, path, "--scheduler", cluster.address]) == 0
    answered = capsys.readouterr()
    assert "nowhere.pcapng" in answered.err and "healthy" in answered.out


@pytest.mark.live
@pytest.mark.slow
def test_a_file_that_kills_all_workers_of_a_cluster_is_reported_and_no_other_is_lost(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("trcvtui.diagnosis.workers.POLL_S", 0.2)
    for _ in range(2):
        cluster.work()
    deadly = tmp_path / "deadly.pcapng"
    deadly.touch()
    paths = [*captures(tmp_path, 3), str(deadly)]
    answers = dict(judge_in_cluster(paths, QUESTION, judge_or_die, cluster.address, CaptureAnswer))
    assert isinstance(answers[str(deadly)], UserError)
    assert sum(not isinstance(answer, UserError) for answer in answers.values()) == 3


NO_ANSWER = "found no answer in what its worker sent, expected one of our version"


@pytest.mark.live
@pytest.mark.slow
@pytest.mark.parametrize(
    "way, wrong",
    [
        ("result", NO_ANSWER),
        ("result that says it is pickled", NO_ANSWER),
        ("wrong keys", NO_ANSWER),
        ("wrong name", ""),
        ("error", ""),
        ("error as an object", ""),
        ("error in no form", ""),
        ("type", ""),
        ("warning", ""),
    ],
)
def test_a_hostile_worker_runs_no_code_here(
    cluster: Cluster,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    way: str,
    wrong: str,
) -> None:
    from distributed import Client

    (hostile := tmp_path / "hostile").mkdir()
    ours = hostile / str(os.getpid())
    monkeypatch.setenv("HOSTILE_FOLDER", str(hostile))
    monkeypatch.setenv("HOSTILE_WAY", way)
    cluster.work("--preload", str(Path(__file__).with_name("hostile_worker.py")))
    (path,) = captures(tmp_path, 1)
    # What is not judged by the worker is judged here, or has its line.
    assert main(["doctor", path, "--scheduler", cluster.address]) == (2 if wrong else 0)
    said = capsys.readouterr()
    assert (wrong in said.err) if wrong else ("healthy" in said.out)
    assert "\x1b" not in said.out
    assert not ours.exists()
    if way.startswith(("wrong", "result that", "error in")):
        return
    with Client(cluster.address, set_as_default=False) as client, warnings.catch_warnings():  # it is hostile
        warnings.simplefilter("ignore")
        task = client.submit(workers._judge_at_worker, path, QUESTION, try_to_judge, pure=False)
        with contextlib.suppress(Exception):
            task.result()
        while not ours.exists():
            os.sched_yield()


def test_a_message_of_a_hostile_scheduler_that_says_it_is_pickled_runs_no_code_here(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="Dask is not installed: pip install 'trcvtui[cluster]'")
    from distributed import protocol

    class Code:
        def __reduce__(self) -> tuple[object, ...]:
            return Path.touch, (tmp_path / "ran",)

    sent = protocol.dumps({"op": protocol.ToPickle(Code())})
    with workers._forbid_unpickling():
        assert protocol.loads(sent) == {"op": None}
    assert not (tmp_path / "ran").exists()
    protocol.loads(sent)
    assert (tmp_path / "ran").exists()


def test_a_scheduler_that_is_not_there_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("trcvtui.diagnosis.workers.CONNECT_S", 0.2)
    (path,) = captures(tmp_path, 1)
    assert main(["doctor", path, "--scheduler", "tcp://127.0.0.1:1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("--scheduler: found ")
