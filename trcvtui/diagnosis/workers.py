"""Several workers judge captures: processes of this machine, or workers of a Dask cluster.

Rule 1: if a worker dies, another worker tries its file. After 2 deaths the file is reported.
Rule 2: bytes from a cluster run no code here. An answer is read only as JSON of one form.
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import get_context
from types import SimpleNamespace
from typing import Any, Final, TypeVar
from unittest.mock import patch

import msgspec

from trcvtui.errors import Problem, UserError, mistake, require

Question = TypeVar("Question")
Answer = TypeVar("Answer")
PathAnswers = Iterator[tuple[str, Answer | UserError]]
JudgeFunction = Callable[[str, Question], Answer | UserError]
MOST_DEATHS: Final = 2  # of workers with one file
CONNECT_S: Final = 10
POLL_S: Final = 5  # between two checks of the list of workers
MOST_TASKS: Final = 256  # of a cluster at once


def judge_in_processes(
    paths: Sequence[str], asked: Question, judge: JudgeFunction[Question, Answer], jobs: int
) -> PathAnswers[Answer]:
    remaining = paths
    while remaining:
        lost = yield from _judge_in_pool(remaining, asked, judge, jobs)
        near = 2 * jobs + 1  # so many had begun: one of them killed its worker, which breaks the whole pool
        for path in lost[:near]:
            if (yield from _judge_in_pool([path], asked, judge, 1)):
                yield path, _make_death_error(path)
        remaining = lost[near:]


def _judge_in_pool(
    paths: Sequence[str], asked: Question, judge: JudgeFunction[Question, Answer], jobs: int
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


def _make_death_error(path: str) -> UserError:
    return mistake(path, f"{MOST_DEATHS} workers died of it", "a capture that can be judged")


# -- a cluster -----------------------------------------------------------------------------------------------


def judge_in_cluster(
    paths: Sequence[str], asked: Question, judge: JudgeFunction[Question, Answer], scheduler: str, form: Any
) -> PathAnswers[Answer]:
    """Yield the answers of a cluster as they come. Each capture is one task, and a worker reads it.

    `form` is the type of an Answer. Files that no worker can open are read here. UserError: no scheduler.
    """
    dask = require("distributed", "cluster", "--scheduler", "no Dask")
    here: list[str] = []
    with _forbid_unpickling():
        try:
            client = dask.Client(
                scheduler, timeout=CONNECT_S, set_as_default=False, deserializers=["msgpack"]
            )
        except Exception as failed:  # a bad URL, name, port or version: each raises its own type
            expected = "tcp://HOST:8786 of a Dask scheduler"
            raise mistake("--scheduler", f"{scheduler} ({failed})", expected) from None
        there = partial(_judge_at_worker, asked=asked, judge=judge)
        reply = msgspec.json.Decoder(tuple[str, form | None, tuple[Problem, ...]])
        with client, client.as_current():
            yield from _judge_in_workers(client, paths, there, reply, here)
    yield from judge_in_processes(here, asked, judge, 1)


@contextmanager
def _forbid_unpickling() -> Iterator[None]:
    """Prevent Dask from building objects (rule 2). Data stays bytes. Pickles become None or a KilledWorker.

    Dask's own `deserializers` do not cover errors, types of results, warnings, and data marked as pickled.
    """
    from distributed import KilledWorker, client, protocol

    def load_killed_worker(data: bytes, *, buffers: object = ()) -> Exception | None:
        return KilledWorker("", None, 0) if b"KilledWorker" in bytes(data)[:64] else None

    names = SimpleNamespace(loads=load_killed_worker, dumps=pickle.dumps)
    with (
        patch.object(protocol.core, "merge_and_deserialize", lambda _, frames, **__: b"".join(frames)),
        patch.object(protocol.pickle, "pickle", names),
        patch.object(client, "pickle", names),
        patch.object(client.Client, "_default_event_handlers", {}),  # prints and warnings of workers
    ):
        yield


def _judge_in_workers(
    client: Any, paths: Sequence[str], there: Callable[[str], bytes], reply: Any, here: list[str]
) -> PathAnswers[Any]:
    """Yield the answers of a cluster's workers. Add the files that no worker can read to `here`."""
    from distributed import KilledWorker, wait

    queue: list[tuple[str, tuple[str, ...]]] = [(path, ()) for path in reversed(paths)]
    tasks: dict[Any, tuple[str, tuple[str, ...]]] = {}
    while queue or tasks:
        workers = list(client.scheduler_info(n_workers=-1)["workers"])
        while queue and len(tasks) < MOST_TASKS:
            path, been_at = queue.pop()
            other = [each for each in workers if each not in been_at]
            if not other:
                here.append(path)
                continue
            only = {"workers": other} if been_at else {}
            task = client.submit(there, os.path.abspath(path), pure=False, **only)
            tasks[task] = path, been_at
        with suppress(TimeoutError, CancelledError):
            if tasks:
                wait(list(tasks), timeout=POLL_S, return_when="FIRST_COMPLETED")
        done = [task for task in tasks if task.done()]
        if not done and not workers:  # all have gone
            here += [path for path, _ in (*tasks.values(), *queue)]
            return
        for task in done:
            path, been_at = tasks.pop(task)
            if task.status in ("error", "cancelled"):
                if task.status == "error" and isinstance(task.exception(), KilledWorker):
                    yield path, _make_death_error(path)
                else:  # a worker that cannot run this program
                    here.append(path)
                continue
            try:
                packed = task.result(timeout=POLL_S)
                worker, answer, problems = reply.decode(msgspec.msgpack.decode(packed, type=bytes))
            except Exception as failed:
                if isinstance(failed, TimeoutError) or task.status == "error":
                    tasks[task] = path, been_at  # its worker died with the answer: Dask tries another
                else:
                    yield path, mistake(path, "no answer in what its worker sent", "one of our version")
                continue
            if answer is not None or problems:
                yield path, UserError(problems) if problems else answer
            elif worker in been_at or worker not in workers:  # else it would be tried forever
                here.append(path)
            else:
                queue.append((path, (*been_at, worker)))


def _judge_at_worker(path: str, asked: Question, judge: JudgeFunction[Question, Answer]) -> bytes:
    """Return worker, answer and problems in JSON, the last two empty if the worker cannot open the file."""
    from distributed import get_worker

    answer: Answer | UserError | None = None
    with suppress(OSError), open(path, "rb"):
        answer = judge(path, asked)
    problems = answer.problems if isinstance(answer, UserError) else ()
    return msgspec.json.encode((get_worker().address, None if problems else answer, problems))
