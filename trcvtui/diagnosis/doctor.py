"""`trcvtui doctor` judges captures and recordings. It writes text, or a JSON object for each verdict."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from msgspec import Struct, to_builtins
from msgspec.structs import replace

from trcvtui.blocks.conditions import Condition
from trcvtui.capture.command import capture_notes
from trcvtui.capture.packets import SkipReason
from trcvtui.capture.plc_end import KnownEnds, PlcEnd, make_no_match_error, parse_plc
from trcvtui.capture.quality import CaptureLimit
from trcvtui.diagnosis.cause_words import CAUSE_WORDS, default_remedies
from trcvtui.diagnosis.causes import LineCase, judge_case, make_cases
from trcvtui.diagnosis.host_causes import list_host_facts, make_host_finding
from trcvtui.diagnosis.line_facts import CaptureFacts, LineFacts, collect_facts
from trcvtui.diagnosis.receiver import Receiver
from trcvtui.diagnosis.symptoms import list_explaining_causes
from trcvtui.errors import UserError, one_line
from trcvtui.snapshots.doctor import Ends, Finding
from trcvtui.wording import count, json_text

if TYPE_CHECKING:
    from trcvtui.project.project import Project
    from trcvtui.udt.layout.layout import Layout

EXIT_HEALTHY, EXIT_FINDINGS, EXIT_NOT_JUDGED = 0, 1, 2
# The `verdict` of a conversation; `partly`: no finding, and not everything could be judged.
VERDICT_HEALTHY, FINDINGS, PARTLY, NOTHING = "healthy", "findings", "partly", "nothing"
VERDICT_TEXTS: Final = {
    VERDICT_HEALTHY: "healthy",
    PARTLY: "nothing is wrong in the part that could be judged",
    NOTHING: "nothing could be judged",
}
NO_LINE: Final = 0  # in place of the number of a conversation
_GONE_HOST: Final = {"dead-link", "half-open", "no-keep-alive"}  # afterwards their host has no ARP answer
GROUP_CAUSES: Final = ("closes-each-message", "reconnect-storm")  # each names all conversations of both ends
ENDING_CAUSES: Final = (*GROUP_CAUSES, "resets", "refused", "turned-away", "filtered", "second-client")
SHIFT_LIKE_CAUSES: Final = ("adhoc-missing", "frame-short", "frame-long")
BYTE_CAUSES: Final = {
    "datagram-size": "encoding"
}  # what the program meets, and the cause in the bytes that explains it


class LineVerdict(Struct, forbid_unknown_fields=True):
    """The verdict on a conversation. If `conversation` is None, the verdict is on a file or project."""

    conversation: Ends | None
    findings: list[Finding]
    quality: list[CaptureLimit] = []
    remarks: list[Finding] = []
    not_judged: dict[str, CaptureLimit] = {}
    is_judged: bool = True
    file: str = ""

    @property
    def word(self) -> str:
        judged = VERDICT_HEALTHY if self.is_judged else NOTHING
        return FINDINGS if self.findings else PARTLY if self.not_judged else judged


class RecordedFacts(NamedTuple):
    """Facts of one of our recordings that its packets do not show. `connects` is as in KnownEnds.

    `harms` has the times (UTC) of ERRORs and lost jobs of the blocks of each CONNECT. `until_ns` is the UTC
    of the last scan, until which silence is a fact. `lint` has findings on the project and its last pins.
    """

    receivers: tuple[Receiver, ...]
    connects: Mapping[tuple[int, str], str]
    harms: Mapping[str, Sequence[int]]
    troubles: tuple[Finding, ...]  # what its program did wrong: `at` first when (UTC), in which `scan`
    until_ns: int = 0
    lint: tuple[Finding, ...] = ()
    is_running: bool = False  # the run has not ended
    symptoms: tuple[Finding, ...] = ()


class DoctorQuestion(NamedTuple):
    """The options beside the captures on the command line, as plain data that workers get as well.

    `recorded` returns the facts of a recording, or None if the capture is not one of ours.
    """

    plc: str | None = None
    receivers: tuple[Receiver, ...] = ()
    recorded: Callable[[str], RecordedFacts | None] | None = None

    def known_ends(self) -> KnownEnds:
        some = [one for one in self.receivers if one.connect]
        listens, calls = (
            frozenset(one.local_port for one in some if not one.active) - {0},
            frozenset(one.remote_port for one in some if one.active) - {0},
        )
        own, partners = {one.own_address for one in some}, {one.partner_address for one in some}
        return KnownEnds(listens, calls, frozenset(own) - {b""}, frozenset(partners) - {b""})


def make_type_receiver(layout: Layout, sender: str = "") -> Receiver:
    """Return a receiver of messages of one type, for all conversations."""
    kind = Receiver("", "", layout.size, is_only=True, type_name=layout.name, type=layout.type)
    return kind._replace(rules=layout.rules, sender=sender)


# -- one capture ---------------------------------------------------------------------------------------------


def judge_capture(path: str, asked: DoctorQuestion) -> tuple[list[LineVerdict], list[str], float]:
    """Return the verdicts and notes on one capture and its length in hours, or raise UserError."""
    given = None if asked.plc is None else parse_plc(asked.plc)
    known = None if asked.recorded is None else asked.recorded(path)
    if known is not None and not asked.receivers:
        asked = asked._replace(receivers=known.receivers)
    ends, until_ns = asked.known_ends(), 0
    if known is not None:
        ends, until_ns = ends._replace(connects=known.connects), known.until_ns
    receives = any(not one.connect for one in asked.receivers)
    facts = collect_facts([path], given, ends, receives, until_ns)
    if facts.troubles and not facts.found.packets:  # else the part before the trouble is judged
        raise UserError(facts.troubles)
    if known is not None:
        facts.found.not_read.pop(SkipReason.JOURNAL, None)  # its journal
        for each in facts.lines:
            each.harms = known.harms.get(each.connect or "", ())
    cases = [*make_cases(_select_lines(facts, asked), asked.receivers, facts.last_ns)]
    troubles: dict[int, list[Finding]] = {}
    for line, one in (_assign_line(each, cases) for each in (known.troubles if known is not None else ())):
        troubles.setdefault(NO_LINE if line is None else line.number, []).append(one)
    is_running = known is not None and known.is_running
    verdicts = [judge_line(case, troubles.get(case.line.number, []), is_running) for case in cases]
    alone = troubles.get(NO_LINE, [])
    if known is not None:
        alone = _judge_symptoms(known, cases, verdicts, alone)
    else:
        alone = _judge_hosts(facts, asked, given, cases, verdicts)
    if alone:
        verdicts.append(LineVerdict(None, _sort_by_confidence(alone)))
    if not verdicts:  # of a recording at least the run was judged
        verdicts.append(LineVerdict(None, [], is_judged=known is not None))
    for made in verdicts:
        made.findings = [replace(one, ends=made.conversation) for one in made.findings]
        made.remarks = [replace(one, ends=made.conversation) for one in made.remarks]
    hours = (facts.last_ns - (facts.found.first_ns or facts.last_ns)) / 3.6e12
    return verdicts, [*capture_notes(facts.found, list(facts.troubles), with_hosts=False)], hours


def _judge_hosts(
    facts: CaptureFacts, asked: DoctorQuestion, given: PlcEnd | None, cases: Sequence[LineCase],
    verdicts: Sequence[LineVerdict],
) -> list[Finding]:  # fmt: skip
    """Return the findings that `list_host_facts` marks True; add the others to conversations as remarks."""
    alone, of_host = [], dict[bytes, list[tuple[LineFacts, LineVerdict]]]()
    for case, made in zip(cases, verdicts, strict=True):
        for host in {case.line.plc_end[0], case.line.partner_end[0]}:
            of_host.setdefault(host, []).append((case.line, made))
    for one, is_ours in list_host_facts(facts, asked.receivers, b"" if given is None else given.address):
        rows = of_host.get(one.ends[0], [])
        if any(line.gone and row.cause in _GONE_HOST for line, made in rows for row in made.findings):
            continue  # a finding of its conversation covers it
        found = make_host_finding(one, asked.receivers)
        if not is_ours:
            line, made = (rows or [(cases[0].line, verdicts[0])])[0]
            made.remarks.append(fill_finding(found, line))
            continue
        its = (each for each in asked.receivers if {each.own_address, each.partner_address} & {*one.ends})
        words = next((each.words for each in its), {})
        t_s = (one.ns - (facts.found.first_ns or 0)) / 1e9 if one.packets else None
        alone.append(fill_finding(replace(found, t_s=t_s), words=words))
    return alone


def _assign_line(one: Finding, cases: Sequence[LineCase]) -> tuple[LineFacts | None, Finding]:
    """Return the finding's conversation (at its time, else last before, else first), and the finding."""
    ns = one.at[0] if one.at is not None else 0
    lines = [case.line for case in cases if case.line.connect in (None, one.connect)]
    line = next((each for each in lines if each.first_ns <= ns <= each.last_ns), None)
    line = line or next((each for each in reversed(lines) if each.first_ns <= ns), None)
    line = line or (lines[0] if lines else None)
    return line, fill_finding(replace(one, t_s=None if line is None else max(line.to_seconds(ns), 0.0)))


def _judge_symptoms(
    known: RecordedFacts, cases: Sequence[LineCase], verdicts: list[LineVerdict], before: list[Finding]
) -> list[Finding]:
    """Add to each finding the symptoms that it explains. Return all findings without a conversation.

    An unexplained symptom is a finding of its conversation. `before` has findings without a conversation.
    """
    alone, lint, new = [*before], dict[int, int](), list[tuple[LineFacts, Finding]]()
    of_line = {case.line.number: made.findings for case, made in zip(cases, verdicts, strict=True)}
    known_places = [(each.line.connect, of_line[each.line.number], n) for each in cases
                    for n in range(len(of_line[each.line.number]))]  # fmt: skip
    known_places += [(row.connect, alone, n) for n, row in enumerate(before)]
    for one in known.symptoms:
        causes = list_explaining_causes(one)
        places = [each for each in known_places if each[0] in (None, one.connect)]
        found = [(some, n) for _, some, n in places if some[n].cause in causes]
        if not found:  # else the project may explain it, without any traffic
            for number, each in enumerate(known.lint):
                is_its = each.cause in causes and each.instance in ("", one.instance)
                if is_its and (not (one.status and each.status) or one.status[0] in each.status):
                    if number not in lint:
                        lint[number] = len(alone)
                        alone.append(fill_finding(each))
                    found.append((alone, lint[number]))
        for some, n in found:
            some[n] = _add_explained_symptom(some[n], one)
        if found:
            continue
        line, row = _assign_line(one, cases)
        if line is None:
            alone.append(row)
        else:
            new.append((line, row))
    for line, row in new:
        of_line[line.number][:] = _sort_by_confidence([*of_line[line.number], row])
    return alone


def _add_explained_symptom(found: Finding, one: Finding) -> Finding:
    evidence = (*[each for each in one.evidence[1:] if each not in found.evidence], *found.evidence)
    better = {"mend": one.mend, "status": one.status, "evidence": evidence} if one.is_fact else {}
    return replace(found, explains=(*found.explains, *one.explains), **better)


def _sort_by_confidence(some: Iterable[Finding]) -> list[Finding]:
    """Return findings, the surest first; equal ones keep their order."""
    return sorted(some, key=lambda one: -one.confidence)


def _select_lines(facts: CaptureFacts, asked: DoctorQuestion) -> tuple[LineFacts, ...]:
    """Return the conversations of the PLC end that `--plc` names. Raise UserError if there are none."""
    if asked.plc is None:
        return facts.lines
    found = tuple([line for line in facts.lines if line.guess.why == "--plc"])
    if not found and facts.lines:
        raise make_no_match_error("--plc", f"'{asked.plc}', which no conversation has", facts.found.all)
    return found


def judge_line(case: LineCase, troubles: Sequence[Finding] = (), is_running: bool = False) -> LineVerdict:
    """Return the verdict on one conversation. `troubles` is what the recorded program did wrong.

    While the run continues, leave out causes that are over. A cause that ends connections is over once a
    connection stays open. Another cause is over once its conversation has ended and another conversation
    still sends.
    """
    line = case.line
    found, remarks, not_judged = judge_case(case)
    words = case.receiver.words if case.receiver is not None else {}
    if is_running:
        is_over = case.group.has_recovered, line.end is not None and case.group.is_still_sending
        found = tuple([one for one in found if not is_over[one.cause not in ENDING_CAUSES]])
    causes = {one.cause for one in found}
    troubles = [one for one in troubles if BYTE_CAUSES.get(one.cause) not in causes]
    # Frames that the program has shifted only look like these causes.
    like = SHIFT_LIKE_CAUSES if any(one.cause == "shifted" for one in troubles) else ()
    rows = [fill_finding(one, line, words) for one in found if one.cause not in like]
    return LineVerdict(
        Ends(line.plc, line.partner, line.protocol),
        _sort_by_confidence(_merge_findings(troubles, rows)) if troubles else rows,
        sorted(line.qualities),
        [fill_finding(one, line) for one in remarks],
        not_judged,
    )


def _merge_findings(troubles: Sequence[Finding], found: list[Finding]) -> list[Finding]:
    """Return one finding per cause. If program and packets show one cause, keep the packets' finding."""
    alone, number_of = [], {one.cause: number for number, one in enumerate(found)}
    for one in troubles:
        if (number := number_of.get(one.cause)) is None:
            alone.append(one)
        else:
            evidence = (*found[number].evidence, *one.evidence)
            found[number] = replace(found[number], evidence=evidence, scan=one.scan)
    return [*alone, *found]


def judge_project(project: Project) -> LineVerdict:
    """Return what is wrong with a project before it runs, by lint and by a dry run of three seconds."""
    from trcvtui.diagnosis.dry_run import find_errors
    from trcvtui.diagnosis.lint import lint

    known = RecordedFacts((), {}, {}, (), lint=lint(project, has_run=False), symptoms=find_errors(project))
    shown = _judge_symptoms(known, [], [], [])
    known_rows = {(one.cause, one.evidence) for one in shown}
    rows = [fill_finding(one) for one in known.lint if (one.cause, one.evidence) not in known_rows]
    return LineVerdict(None, _sort_by_confidence([*rows, *shown]), file=str(project.path))


def fill_finding(
    found: Finding, line: LineFacts | None = None, words: Mapping[Condition, int] = {}
) -> Finding:
    """Return a finding with the words of its cause, and its packets, filter and time in the conversation.

    `words` has the STATUS that the block shows for each condition, if the block is known.
    """
    at, row, t_s, packets, shown = found.at, CAUSE_WORDS[found.cause], found.t_s, found.packets, found.filter
    if line is not None:
        t_s = line.to_seconds(at[0]) if at is not None else None
        packets = packets or (at[3] if at is not None and at[3] else line.first_packet,)
        shown = line.make_filter(shown or row.filter, found.cause in GROUP_CAUSES)
    leads_to = row.leads_to if found.leads_to is None else found.leads_to
    status = found.status or tuple([f"{words[one]:04X}" for one in leads_to if one in words])
    return replace(
        found, title=row.title, confidence=round(found.confidence, 2), t_s=t_s, packets=packets, filter=shown,
        status=status, mend=found.mend or default_remedies(found.cause), trial=None,
    )  # fmt: skip


def as_json(made: LineVerdict) -> dict[str, Any]:
    """Return a verdict for `--format json`. Keys may be added, but never removed or renamed."""
    findings = [
        {**_remark_as_json(one), "confidence": one.confidence, "status": one.status, "explains": one.explains,
         "mend": to_builtins(one.mend)} for one in made.findings
    ]  # fmt: skip
    not_judged = [{"cause": cause, "quality": why} for cause, why in made.not_judged.items()]
    return {
        "file": made.file, "conversation": to_builtins(made.conversation), "healthy": not findings,
        "verdict": made.word, "findings": findings, "quality": made.quality,
        "remarks": [*map(_remark_as_json, made.remarks)], "not_judged": not_judged,
    }  # fmt: skip


def _remark_as_json(one: Finding) -> dict[str, Any]:
    packet = one.at[3] if one.at is not None else 0
    where = {"direction": one.way or None, "byte": one.byte, "packet": packet or None, "scan": one.scan,
             "instance": one.instance or None}  # fmt: skip
    return {"cause": one.cause, "title": one.title, "t_s": one.t_s, "where": where, "evidence": one.evidence,
            "packets": one.packets, "filter": one.filter}  # fmt: skip


# -- all of them ---------------------------------------------------------------------------------------------


def run_doctor(
    paths: Sequence[str],
    asked: DoctorQuestion,
    form: str,
    jobs: int,
    before: Iterable[LineVerdict] = (),
    names: Mapping[str, str] | None = None,
    scheduler: str | None = None,
) -> int:
    """Write the verdicts on captures as they come. Return 0: all healthy, 1: findings, 2: nothing judged.

    `names` has other names for files in verdicts. With a Dask `scheduler`, its cluster judges instead
    of `jobs` processes.
    """
    write, total, is_first = sys.stdout.write, _Total(), True
    for made in before:
        is_first = _write(write, [made], form, is_first)
        total.add(made)
    for path, answer in _judge_captures(paths, asked, jobs, scheduler):
        if isinstance(answer, UserError):
            for text in answer.lines():
                sys.stderr.write(f"{text}\n")
            continue
        verdicts, notes, hours = answer
        total.files += 1
        total.hours += hours
        for made in verdicts:
            made.file = (names or {}).get(path, path)
            total.add(made)
        is_first = _write(write, verdicts, form, is_first)
        for note in notes:
            sys.stderr.write(one_line(f"{(names or {}).get(path, path)}: {note}") + "\n")
        if len(paths) > 1 and sys.stderr.isatty():
            sys.stderr.write(f"{total.files} of {len(paths)} captures\n")
        sys.stdout.flush()
    if form == "json":
        write("[]\n" if is_first else "\n]\n")
    if not total.judged:
        return EXIT_NOT_JUDGED
    if len(paths) > 1:
        sys.stderr.write(total.text() + "\n")
    return EXIT_FINDINGS if total.causes else EXIT_HEALTHY


class _Total:
    def __init__(self) -> None:
        self.files = self.conversations = self.judged = 0
        self.hours = 0.0
        self.causes: Counter[str] = Counter()

    def add(self, made: LineVerdict) -> None:
        self.conversations += made.conversation is not None
        self.judged += made.is_judged
        self.causes.update({one.cause for one in made.findings})

    def text(self) -> str:
        found = ", ".join(f"{cause} {times}" for cause, times in self.causes.most_common())
        return (
            f"{count(self.files, 'capture')}, {count(self.conversations, 'conversation')}, "
            f"{self.hours:.1f} h: {found or 'healthy'}"
        )


CaptureAnswer = tuple[list[LineVerdict], list[str], float]


def _judge_captures(
    paths: Sequence[str], asked: DoctorQuestion, jobs: int, scheduler: str | None
) -> Iterator[tuple[str, CaptureAnswer | UserError]]:
    if scheduler is None and (jobs <= 1 or len(paths) == 1):
        for path in paths:
            yield path, try_to_judge(path, asked)
        return
    from trcvtui.diagnosis.workers import judge_in_cluster, judge_in_processes

    if scheduler is None:
        yield from judge_in_processes(paths, asked, try_to_judge, jobs)
    else:
        yield from judge_in_cluster(paths, asked, try_to_judge, scheduler, CaptureAnswer)


def try_to_judge(path: str, asked: DoctorQuestion) -> CaptureAnswer | UserError:
    """Return the verdicts on one capture, or why there are none."""
    try:
        return judge_capture(path, asked)
    except UserError as error:
        return error


def _write(write: Callable[[str], object], made: Sequence[LineVerdict], form: str, is_first: bool) -> bool:
    if form == "text":
        write("".join(f"{one_line(text)}\n" for text in _format_verdicts(made)))
        return False
    for one in made:
        before = "" if form == "jsonl" else "[\n" if is_first else ",\n"
        write(before + json_text(as_json(one)) + ("\n" if form == "jsonl" else ""))
        is_first = False
    return is_first


INDENT: Final = "    "
MOST_LINES: Final = 4  # that are named, of several with equal findings


def _format_verdicts(verdicts: Sequence[LineVerdict]) -> Iterator[str]:
    groups: dict[object, tuple[Finding, list[str]]] = {}
    for made in verdicts:
        for one in made.findings:
            same = groups.setdefault(finding_key(one), (one, []))
            same[1].extend(_ends_text(made))
    file, before = verdicts[0].file if verdicts else "", None
    for one, lines in sorted(groups.values(), key=lambda each: -each[0].confidence):
        what = count(len(lines), "conversation") if len(lines) > 1 else "".join(lines)
        if lines != before:
            yield ": ".join(filter(None, (file, what)))
        before = lines
        yield from _format_finding(one)
        if len(lines) > 1:
            more = f", and {len(lines) - MOST_LINES} more" if len(lines) > MOST_LINES else ""
            yield f"{INDENT}lines: {', '.join(lines[:MOST_LINES])}{more}"
    for verdict, words in VERDICT_TEXTS.items():
        some = [made for made in verdicts if made.word == verdict]
        ends = "".join(_ends_text(some[0])) if len(some) == 1 else ""
        what = count(len(some), "conversation") if len(some) > 1 else ends
        yield from [": ".join(filter(None, (file, what, words)))] if some else []
    yield from _notes(verdicts)


def finding_key(one: Finding) -> tuple[object, ...]:
    """Return what equal findings of several conversations share: cause, STATUS, direction, instance, port."""
    ends = (one.ends.plc, one.ends.partner) if one.ends is not None else ()
    ports = [int(port) for port in (each.rpartition(":")[2] for each in ends) if port.isdecimal()]
    return one.cause, *one.status, one.way, one.instance, min(ports, default=0)


def _ends_text(made: LineVerdict) -> list[str]:
    return [f"{made.conversation.protocol} {made.conversation}"] if made.conversation is not None else []


def _format_finding(one: Finding) -> Iterator[str]:
    when = "" if one.t_s is None else f" at {one.t_s:.3f} s"
    place = "".join(f", {each}" for each in (one.way.replace("-", " "), one.instance) if each)
    yield f"  {one.cause} ({one.confidence:.0%} sure){when}{place}: {one.title}"
    yield from (INDENT + text for text in one.evidence)
    yield from (f"{INDENT}explains: {text}" for text in one.explains if text not in one.evidence)
    if one.status:
        yield f"{INDENT}STATUS {', '.join(one.status)}"
    packets = ", ".join(map(str, one.packets))
    seen = filter(None, (f"packets {packets}" if packets else "", one.filter))
    yield from [f"{INDENT}Wireshark: {' · '.join(seen)}"] if packets or one.filter else []
    yield from (INDENT + mend.display_line for mend in one.mend)


def _notes(some: Sequence[LineVerdict]) -> Iterator[str]:
    remarks = Counter(f"{one.cause}: {''.join(one.evidence[-1:])}" for made in some for one in made.remarks)
    yield from (f"  remark {text}" + (f" ({often} times)" if often > 1 else "") for text, often in
                remarks.most_common(MOST_LINES))  # fmt: skip
    qualities = Counter(each for made in some for each in made.quality if each != CaptureLimit.ENDS_EARLY)
    if qualities:
        texts = [f"{each} {often}" if often > 1 else each for each, often in qualities.items()]
        yield f"  quality: {', '.join(texts)}"
    blind: dict[str, list[str]] = {}
    for cause, why in (each for made in some for each in made.not_judged.items()):
        causes = blind.setdefault(why, [])
        causes += [] if cause in causes else [cause]
    for quality, causes in blind.items():
        yield f"  cannot be judged with {quality}: {', '.join(causes)}"
