"""What the set-up of a connection proves: what it waits for, since when, what answered, who was refused."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import CauseKind
from trcvtui.diagnosis.evidence import Evidence
from trcvtui.diagnosis.job import RuleAnswer, as_advised_cause, tip
from trcvtui.history.records import SETUP_CALLS, FailureCount
from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.connection.description import format_selector
from trcvtui.net.connection.description_check import Transport, read_spec
from trcvtui.plc.ledger import StatusEdge
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.project.project import Project
from trcvtui.snapshots.bench import PeerSnapshot
from trcvtui.wording import SECOND, age_text, count, format_ns, times

ANY_ADDRESS: Final = "0.0.0.0"
NS_PER_MS: Final = SECOND // 1000
QUIET_NS: Final = 10 * SECOND  # without a byte after messages: most senders pause shorter
MOST_FAILURES: Final = 2  # kinds of failed attempts that are named, the newest

_PORT_TAKEN: Final = tip("another program or CONNECT uses {local}", "`ss -ltnp` shows which")
# How an attempt failed -> what that proves, and what to do.
FAILURE_ANSWERS: Final[dict[str, RuleAnswer]] = {
    "connect ECONNREFUSED": "{peer} answers with RST: the machine is on, but nothing listens on that port",
    "attempt_limit ETIMEDOUT": "{peer} does not answer SYN: wrong address, bad cable, or a firewall drops it",
    "connect ETIMEDOUT": "{peer} does not answer SYN: wrong address, bad cable, or a firewall drops it",
    "connect EHOSTUNREACH": "{peer} does not answer ARP, or a router cannot reach it: wrong address, or off",
    "connect ENETUNREACH": tip("no route leads to {peer}", "check LocalAddress, mask and gateway"),
    "connect EADDRNOTAVAIL": "the local end towards {peer} is not free: the fixed LocalPort is in TIME_WAIT",
    "connect EADDRINUSE": tip("LocalPort is fixed and in use towards {peer}", "LocalPort 0 takes a free one"),
    "bind EADDRINUSE": _PORT_TAKEN,
    "listen EADDRINUSE": _PORT_TAKEN,
    "bind EACCES": tip(
        "{local}: only some users may use ports below 1024", "take a larger LocalPort or IsoPort"
    ),
    "bind EADDRNOTAVAIL": tip(
        "{local} belongs to no interface of this machine", "`ip -br address` lists them"
    ),
    "socket EMFILE": "the process has no file descriptor left",
}

LISTENING: Final = "listening"


def describe_condition(project: Project, name: str, shown: StatusEdge | InstanceSnapshot) -> str:
    """Return the word beside a STATUS, such as `listening` for a passive CONNECT with a listener."""
    decl, cause = project.instance(name), shown.cause
    connect = project.connect(decl.connect) if decl is not None else None
    waits = shown.condition == Condition.ESTABLISHING and connect is not None and not connect.active
    if waits and (cause.local or cause.why is not CauseKind.WAITING):
        return LISTENING
    return project.dialect.label(shown.condition)


ERRNO_WORDS: Final = {"ECONNREFUSED": "refused", "ETIMEDOUT": "unanswered"}
# Failed handshakes: these words alone, without the errno.
SESSION_ERROR_WORDS: Final = {
    ("session", "ECONNREFUSED"): "accepted and then refused by the partner",
    ("session", "ECONNRESET"): "accepted and then ended by the partner",
}
CALL_FAILURE_WORDS: Final = {"session": "the handshake failed", "resolve": "the name was not found"}


# -- the wait ---------------------------------------------------------------------------------------------


def describe_setup_wait(e: Evidence) -> str:
    """Return what a set-up waits for, since when, and how far it is, or "" if that is not known."""
    if e.config is None:
        return ""
    return _describe_build_error(e) or (
        _describe_listen(e) if not e.config.active else _describe_call_wait(e)
    )


def _describe_down_time(e: Evidence) -> str:
    since = e.facts.down_since
    return f" since scan {since.scan} ({age_text(e.ns_since(since))})" if since is not None else ""


def _describe_listen(e: Evidence) -> str:
    assert e.config is not None
    anyone = e.config.remote_address == ANY_ADDRESS
    if e.config.is_datagram and (e.link is None or e.link.retry_in_ns is None):
        return "the UDP port is being set up; no partner is needed for that"
    caller = "any partner" if anyone else f"a call from {e.config.remote_address}"
    named = remote_tsap(e.config)
    if named:
        caller = f"a call {'' if anyone else f'from {e.config.remote_address} '}with the TSAP {named}"
    local = e.link.local if e.link is not None else e.cause.local
    if e.link is not None and e.link.retry_in_ns is not None:
        return f"cannot listen{_describe_down_time(e)}{_describe_next_try(e)}"
    where = f", listening on {local}" if local else ", not listening yet"
    return f"waiting for {caller}{_describe_down_time(e)}{where}"


def _describe_next_try(e: Evidence) -> str:
    assert e.link is not None
    return f"; next attempt in {age_text(e.link.retry_in_ns)}" if e.link.retry_in_ns is not None else ""


def _describe_build_error(e: Evidence) -> str:
    attempt = e.facts.attempt
    if attempt is None or attempt.cause.call not in SETUP_CALLS or e.config is None or e.link is None:
        return ""
    detail = f": {attempt.cause.detail}" if attempt.cause.detail else ""
    press = " (press C)" if attempt.cause.call == "description" and e.config.description is not None else ""
    waits = f"{e.config.name} has not been built{_describe_down_time(e)}"
    return f"{waits} because {attempt.cause.name}{press}{detail}{_describe_next_try(e)}"


def remote_tsap(config: ConnectConfig) -> str:
    """Return the T-selector that the partner must have, or "" if the partner has none or may have any."""
    if config.description is None or read_spec(config.description).protocol is not Transport.ISO:
        return ""
    return format_selector(read_spec(config.description).remote_tsap)


def _describe_call_wait(e: Evidence) -> str:
    assert e.config is not None
    end = (
        (e.link.remote if e.link is not None else "") or e.cause.peer or e.config.remote_name or "its partner"
    )
    text = f"waiting for {end}{_describe_down_time(e)}"
    newest = sorted(e.facts.failures, key=lambda failed: failed.last.scan)[-MOST_FAILURES:]
    for failed in newest:
        text += f"; {_describe_failure(failed)}"
    if len(newest) < len(e.facts.failures):
        text += f"; {count(len(e.facts.failures) - len(newest), 'other failure')} before"
    if e.link is None:
        return text
    if e.link.retry_in_ns is not None:
        tried = "" if e.facts.failures else f"{count(e.link.attempts, 'attempt')} so far, the "
        return f"{text}; {tried}next {'attempt ' if not tried else ''}in {age_text(e.link.retry_in_ns)}"
    return f"{text}; no answer to SYN in attempt {e.link.attempts}" if e.link.attempts else text


def _describe_failure(failed: FailureCount) -> str:
    call, errno = failed.call, failed.error
    word = SESSION_ERROR_WORDS.get((call, errno))
    if word and not failed.injected:
        return f"{word} {times(failed.count)} (last in scan {failed.last.scan})"
    word = CALL_FAILURE_WORDS.get(call) or ERRNO_WORDS.get(errno, f"{call} failed")
    injected = ", injected" if failed.injected else ""
    return f"{word} {times(failed.count)} ({errno}{injected}, last in scan {failed.last.scan})"


# -- what to look at --------------------------------------------------------------------------------------


def find_injection(e: Evidence) -> RuleAnswer:
    is_injected = e.cause.injected or any(failed.injected for failed in e.facts.failures)
    text = "a fault injected here caused this, not the network"
    return tip(text, "{}", "fault clear") if is_injected else ""


def explain_failure(e: Evidence) -> RuleAnswer:
    failed = max(e.facts.failures, key=lambda f: f.last.scan, default=None)
    newest = (failed.call, failed.error) if failed is not None else ("", "")
    error = (e.cause.call, e.cause.error) if e.cause.call else newest
    peer = e.cause.peer or (failed.peer if failed else "") or "the partner"
    local = e.config.local if e.config is not None else "the local port"
    answer = as_advised_cause(FAILURE_ANSWERS.get(" ".join(error), ""))
    cause = answer.cause.format(peer=peer, local=local)
    if cause and failed is not None and newest == error and failed.count > 1:
        cause += f" ({times(failed.count)}, last in scan {failed.last.scan})"
    return answer._replace(cause=cause) if cause else ""


def explain_unanswered_call(e: Evidence) -> RuleAnswer:
    """An attempt is running, and no attempt has failed yet."""
    if e.config is None or not e.config.active or e.link is None or e.facts.failures:
        return ""
    if e.link.retry_in_ns is not None or e.link.state == "connected" or not e.link.remote:
        return ""
    try_it = f"`nc -vz {e.link.remote.replace(':', ' ')}`"
    return tip(f"no answer from {e.link.remote} yet", f"try {try_it} from this machine")


def explain_wrong_partner(e: Evidence) -> str:
    turned = e.facts.wrong_partner
    if turned is None or e.config is None:
        return ""
    return (
        f"{turned.peer} called {times(turned.count)} (last in scan {turned.last.scan}) and was turned away: "
        f"RemoteAddress is {e.config.remote_address}"
    )


def explain_second_client(e: Evidence) -> str:
    turned = e.facts.second_client
    if turned is None:
        return ""
    return (
        f"a second client, {turned.peer}, was turned away {times(turned.count)} (last in scan "
        f"{turned.last.scan}): a CONNECT has one partner at a time"
    )


def explain_refused_caller(e: Evidence) -> str:
    """Say why a caller was refused before it was a partner: a failed handshake, or another TSAP."""
    dropped = e.facts.dropped
    if dropped is None or e.config is None or e.config.active:
        return ""
    refused = next((p.name for p in e.peers if p.name in e.callers and p.state == "refused"), dropped.peer)
    text = f"{refused} called and was refused in scan {dropped.at.scan}: {dropped.why}"
    if e.config.description is None or read_spec(e.config.description).protocol is not Transport.ISO:
        return text
    ours = format_selector(read_spec(e.config.description).local_tsap)
    return f"{text}; {e.config.name} has {ours} (LocalTSelector) and expects {remote_tsap(e.config) or 'any'}"


def suggest_peer_action(e: Evidence) -> RuleAnswer:
    """A peer of this bench could be the partner, but does nothing."""
    if e.config is None or e.config.is_datagram or e.is_past or e.link is None:
        return ""
    if e.config.active:
        return _suggest_listen(e)
    callers = [peer for peer in e.peers if peer.name in e.callers]
    if e.peers and not any(peer.active for peer in e.peers):
        names = " and ".join(peer.name for peer in e.peers[:3])
        return tip(f"{e.config.name} and {names} are all passive", "make exactly one of two ends active")
    # A refused peer has called already: to call again would not help.
    busy = ("connected", "connecting", "refused" if e.facts.dropped is not None else "connected")
    waiting = [peer for peer in callers if peer.state not in busy]
    return _suggest_connect(waiting[0]) if waiting else ""


def _suggest_connect(peer: PeerSnapshot) -> RuleAnswer:
    return tip(f"{peer.name}, an active peer, is {peer.state}", "{}", f"peer {peer.name} connect")


def _suggest_listen(e: Evidence) -> RuleAnswer:
    port = e.config.remote_port if e.config is not None else 0
    peer = next((p for p in e.peers if port == f"@{p.name}"), None)
    if peer is None or peer.state in ("listening", "connected"):
        return ""
    return tip(f"{peer.name} is {peer.state}: it does not listen", "{}", f"peer {peer.name} listen")


def explain_lost_connection(e: Evidence) -> str:
    loss = e.facts.loss
    if loss is None or e.facts.up_since is not None:
        return ""
    error = f" ({loss.error}{', injected' if loss.injected else ''})" if loss.error else ""
    lived = f" after {age_text(loss.up_ns)}" if loss.up_ns is not None else ""
    often = f"; lost {times(e.facts.losses)} so far" if e.facts.losses > 1 else ""
    return f"the connection with {loss.peer} ended in scan {loss.at.scan}{lived}: {loss.what}{error}{often}"


def explain_early_request(e: Evidence) -> RuleAnswer:
    pin = e.cause.pin
    since = e.facts.down_since
    if not pin:
        return ""
    wait = f" since scan {since.scan} ({age_text(e.ns_since(since))})" if since is not None else ""
    text = f"{pin} came while the connection was still being built{wait}"
    advice = "set EN_R" if pin == "EN_R" else "repeat the edge"
    return tip(text, f"{advice} when STATUS says connected")


def explain_connection_limit(e: Evidence) -> RuleAnswer:
    used, most = e.budget
    if e.cause.call != "budget":
        return ""
    return tip(f"{used} of {count(most, 'connection')} are in use", "close one, or take a larger model")


def explain_dead_link(e: Evidence) -> RuleAnswer:
    """The partner acknowledged nothing for as long as the keep-alive waits."""
    if e.config is None:
        return ""
    limit = format_ns(3 * e.config.keep_alive_s * SECOND)
    lived = e.facts.loss.up_ns if e.facts.loss is not None else None
    stood = f"; the link had been up for {age_text(lived)}" if lived is not None else ""
    return tip(
        f"{e.cause.peer or 'the partner'} was silent for about {limit} (3 x KeepAliveTimeInterval "
        f"{e.config.keep_alive_s} s){stood}",
        "check cable, switch and the partner's power, not its program",
    )


def explain_quiet_line(e: Evidence) -> RuleAnswer:
    """Messages no longer come. A cut line does not show in STATUS until keep-alive ends the connection."""
    since, patience = e.facts.up_since, max(QUIET_NS, 2 * e.facts.longest_gap_ns)
    if e.config is None or since is None or e.is_past or e.have or e.last_bytes_ns is None:
        return ""
    if e.last_bytes_ns < since.t_ns or e.quiet_ns is None or e.quiet_ns < patience:
        return ""
    limit, peer = (
        format_ns(e.config.dead_after_ms * NS_PER_MS),
        e.link.remote if e.link is not None else "its partner",
    )
    return tip(
        f"no byte for {age_text(e.quiet_ns)}. For up to {limit} a silent partner, one without power "
        "and a cut line look the same; then keep-alive ends a dead connection",
        f"check cable and power of {peer}, or `ping` it",
    )


def explain_partner_end(e: Evidence) -> str:
    """The partner closed or reset the connection: how often, and how far the job was then."""
    cause, loss = e.cause, e.facts.loss
    how = "reset the connection (RST)" if cause.error == "ECONNRESET" else "closed the connection (FIN)"
    text = f"{cause.peer or 'the partner'} {how}"
    if cause.need:
        text += f" when the job had {cause.have} of {count(cause.need, 'byte')}"
    if loss is not None and loss.up_ns is not None:
        text += f"; the connection had been up for {age_text(loss.up_ns)}"
    often = f"; {e.facts.losses} connections lost so far" if e.facts.losses > 1 else ""
    return text + often


def explain_small_messages(e: Evidence) -> str:
    """The partner sent whole messages, but the frame needs more bytes."""
    size, have, need = e.facts.messages.common_size, e.cause.have, e.cause.need
    if not size or not have or not need or have % size or size >= need:
        return ""
    return (
        f"the partner's messages had {count(size, 'byte')}, but a frame has {need}; missing: "
        f"{count(need - have, 'byte')}"
    )
