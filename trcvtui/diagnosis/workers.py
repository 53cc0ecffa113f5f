"""Captures judged by several workers: processes of this machine, or those of a Dask cluster.

Rule: a worker that dies loses no file: it is tried again by another one, and then reported.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any, Final, TypeVar

from trcvtui.errors import UserError, mistake

Question = TypeVar("Question")
Answer = TypeVar("Answer")
Answered = Iterator[tuple[str, Answer | UserError]]
Judge = Callable[[str, Question], Answer | UserError]
MOST_DEATHS: Final = 2  # of workers that had a file
CONNECT_S: Final = 10
LOOK_S: Final = 5  # between two looks whether workers are there
MOST_TASKS: Final = 256  # that a cluster has at once


def answers_of_processes(
    paths: Sequence[str], asked: Question, judge: Judge[Question, Answer], jobs: int
) -> Answered[Answer]:
    left = paths
    while left:
        lost = yield from _of_pool(left, asked, judge, jobs)
        near = 2 * jobs + 1  # so many were with the workers: one of them has killed its own, and with it all
        for path in lost[:near]:
            if (yield from _of_pool([path], asked, judge, 1)):
                yield path, _reported(path)
        left = lost[near:]


def _of_pool(
    paths: Sequence[str], asked: Question, judge: Judge[Question, Answer], jobs: int
) -> Generator[tuple[str, Answer | UserError], None, list[str]]:
    lost: set[str] = set()
    with ProcessPoolExecutor(min(jobs, len(paths)), get_context("spawn")) as pool:
        paths_of = {pool.submit(judge, path, asked): path for path in paths}
        for future in as_completed(paths_of):
            try:
                yield paths_of[future], future.result()
            except BrokenProcessPool:
                lost.add(paths_of[future])
    return [path for path in paths if path in lost]


def _reported(path: str) -> UserError:
    return mistake(path, f"{MOST_DEATHS} workers died of it", "a capture that can be judged")


# -- a cluster -----------------------------------------------------------------------------------------------


def answers_of_cluster(
    paths: Sequence[str], asked: Question, judge: Judge[Question, Answer], scheduler: str
) -> Answered[Answer]:
    """Yield the answers of a cluster as they come: one task a capture, which its worker reads.

    What no worker can open is read here. Raise UserError where there is no such scheduler.
    """
    try:
        from distributed import Client
    except ImportError:
        expected = "it: pip install 'trcvtui[cluster]'"
        raise mistake("--scheduler", "no Dask", expected) from None
    try:
        client = Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except Exception as failed:  # whatever a URL, a name, a door, another version bring
        raise mistake(
            "--scheduler", f"{scheduler} ({failed})", "tcp://HOST:8786 of a Dask scheduler"
        ) from None
    here: list[str] = []
    with client, client.as_current():
        yield from _of_workers(client, paths, asked, judge, here)
    yield from answers_of_processes(here, asked, judge, 1)


def _of_workers(
    client: Any, paths: Sequence[str], asked: Question, judge: Judge[Question, Answer], here: list[str]
) -> Answered[Answer]:
    """Yield the answers of a cluster's workers; put into `here` what none of them can answer."""
    from distributed import wait

    left: list[tuple[str, tuple[str, ...]]] = [(path, ()) for path in reversed(paths)]
    tasks: dict[Any, tuple[str, tuple[str, ...]]] = {}
    while left or tasks:
        workers = list(client.scheduler_info(n_workers=-1)["workers"])
        while left and len(tasks) < MOST_TASKS:
            path, been_at = left.pop()
            other = [each for each in workers if each not in been_at]
            if not other:
                here.append(path)
                continue
            only = {"workers": other} if been_at else {}
            task = client.submit(_judge_there, os.path.abspath(path), asked, judge, pure=False, **only)
            tasks[task] = path, been_at
        try:
            done = wait(list(tasks), timeout=LOOK_S, return_when="FIRST_COMPLETED").done if tasks else ()
        except TimeoutError:
            if not workers:  # all are gone
                here += [path for path, _ in (*tasks.values(), *left)]
                return
            continue
        for task in done:
            path, been_at = tasks.pop(task)
            if task.status == "error":
                if _has_killed(task):
                    yield path, _reported(path)
                else:  # a worker that cannot run us
                    here.append(path)
                continue
            try:
                worker, answer = task.result(timeout=LOOK_S)
            except TimeoutError:  # its worker died with the answer: the scheduler lets another one judge
                tasks[task] = path, been_at
                continue
            if answer is None:
                left.append((path, (*been_at, worker)))
            else:
                yield path, answer


def _has_killed(task: Any) -> bool:
    from distributed import KilledWorker

    return isinstance(task.exception(), KilledWorker)


def _judge_there(
    path: str, asked: Question, judge: Judge[Question, Answer]
) -> tuple[str, Answer | UserError | None]:
    """Return which worker judges, and the answer; None where the file cannot be opened there."""
    from distributed import get_worker

    name = get_worker().address
    try:
        with open(path, "rb"):
            pass
    except OSError:
        return name, None
    return name, judge(path, asked)
