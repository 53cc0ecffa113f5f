"""A Dask worker (`--preload`) whose objects write a file, named by the pid, where they are unpickled."""

from __future__ import annotations

import os
import pickle
from typing import Any

import distributed.worker
import distributed.worker_state_machine
from distributed.protocol import Serialized, ToPickle
from distributed.protocol.serialize import pickle_dumps

import trcvtui.diagnosis.workers

FOLDER = os.environ["HOSTILE_FOLDER"]
WAY = os.environ["HOSTILE_WAY"]
PICKLED: Any = pickle_dumps
JUDGE: Any = getattr(
    trcvtui.diagnosis.workers._judge_at_worker, "honest", trcvtui.diagnosis.workers._judge_at_worker
)


class Code(Exception):
    def __reduce__(self) -> tuple[Any, ...]:
        text = f"import os; open(os.path.join({FOLDER!r}, str(os.getpid())), 'w').close()"
        return exec, (text,)


def judge(path: str, asked: Any, judge: Any) -> Any:
    if WAY.startswith("error"):
        raise Code
    if WAY == "warning":
        distributed.get_worker().log_event("warn", {"message": pickle.dumps(Code())})
        distributed.get_worker().log_event("print", {"args": ("\x1b[2J",)})
    if WAY == "wrong keys":
        return b'["tcp://x", [[{"file": "x"}], [], 0.0], []]'
    if WAY == "wrong name":
        return b'["tcp://x", null, []]'
    return Code() if WAY == "result" else JUDGE(path, asked, judge)


def error(_: BaseException) -> Any:
    code = Code() if WAY == "error as an object" else pickle.dumps(Code())
    sent = Serialized(*PICKLED(code)) if WAY != "error in no form" else Serialized({"serializer": "none"}, [])
    return {
        "status": "error",
        "exception": sent,
        "traceback": None,
        "exception_text": "",
        "traceback_text": "",
    }


class Types:
    """Stands for `pickle` where a worker packs the type of a result."""

    dumps = staticmethod(lambda _: pickle.dumps(Code()))


judge.honest = JUDGE  # type: ignore[attr-defined]  # Dask loads this file twice
trcvtui.diagnosis.workers._judge_at_worker = judge
if WAY == "result":
    distributed.worker.to_serialize = lambda value: Serialized(*PICKLED(value))
if WAY == "result that says it is pickled":
    distributed.worker.to_serialize = lambda value: ToPickle(Code())
if WAY.startswith("error"):
    distributed.worker.error_message = error
if WAY == "type":
    distributed.worker_state_machine.pickle = Types
