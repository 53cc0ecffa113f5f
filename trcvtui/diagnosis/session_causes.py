"""What the layer below or above TCP shows: ISO-on-TCP refused, TLS refused, errors of a serial line."""

from __future__ import annotations

import re
from typing import Final

from trcvtui.diagnosis.line_facts import DirectionFacts, LineFacts, SegmentFacts
from trcvtui.diagnosis.receiver import Receiver
from trcvtui.snapshots.doctor import Finding
from trcvtui.wording import count

_ALERTS: Final = {
    0: "close_notify", 10: "unexpected_message", 20: "bad_record_mac", 40: "handshake_failure",
    42: "bad_certificate", 43: "unsupported_certificate", 44: "certificate_revoked",
    45: "certificate_expired", 46: "certificate_unknown", 47: "illegal_parameter", 48: "unknown_ca",
    49: "access_denied", 50: "decode_error", 51: "decrypt_error", 70: "protocol_version",
    71: "insufficient_security", 80: "internal_error", 86: "inappropriate_fallback", 90: "user_canceled",
    109: "missing_extension", 110: "unsupported_extension", 112: "unrecognized_name",
    113: "bad_certificate_status_response", 115: "unknown_psk_identity", 116: "certificate_required",
    120: "no_application_protocol",
}  # fmt: skip
_MEANINGS: Final = {  # RFC 8446, section 6.2
    42: "the certificate of {other} is damaged, wrongly signed, or bears another name than the one asked for",
    43: "the certificate of {other} is of a kind that it does not accept",
    44: "the certificate of {other} was revoked by its signer",
    45: "the certificate of {other} has expired, or is not valid yet: compare the clocks, too",
    46: "it does not accept the certificate of {other}, and gives no reason",
    47: "a field of the handshake of {other} is wrong, or contradicts another one",
    48: "it does not trust the signer of the certificate of {other}: the CA is missing there",
    70: "it does not speak the TLS version that {other} asks for",
    116: "it asks for a certificate, and {other} shows none",
}
_HTTP: Final = re.compile(rb"[A-Z]{3,10} [^\s]+ HTTP/1\.[01]\r?\n|HTTP/1\.[01] [1-5]")
_REASONS: Final = {
    0: "none given", 1: "congestion", 2: "not attached", 3: "address unknown", 0x80: "normal",
    0x81: "congestion", 0x82: "negotiation failed", 0x83: "duplicate source", 0x84: "mismatched references",
    0x85: "protocol error", 0x87: "reference overflow", 0x88: "refused on this network",
    0x8A: "header length invalid",
}  # fmt: skip
_CR, _CC, _DR, _DT = 0xE0, 0xD0, 0x80, 0xF0
TPKT: Final = 3  # the first byte of a unit of ISO-on-TCP
MOST_UNITS: Final = 8
_ENCRYPTED_ALERT: Final = 19  # bytes: level, description, kind, 16 of the cipher
_HANDSHAKE, _ALERT, _DATA, _CHANGE_CIPHER = 22, 21, 23, 20


def find_unit_heads(flow: DirectionFacts, has_begin: bool) -> list[bytes]:
    """Return the heads of the first units of TLS or ISO-on-TCP, without a gap, or [] if it is neither.

    If the capture lacks the beginning, the first unit may begin at one of the first writes.
    """
    content = flow.content
    for at in [0] if has_begin else [write.at for write in flow.writes[:MOST_UNITS]]:
        heads, size = list[bytes](), 1
        while size and at + 7 <= len(content) and len(heads) < MOST_UNITS:
            head = bytes(content[at : at + 7])
            size = _unit_size(head) if not heads or is_tls_head(head) == is_tls_head(heads[0]) else 0
            at += size
            heads += [head] if at <= len(content) else []
        if size and heads:
            return heads
    return []


def is_tls_head(head: bytes) -> bool:
    return head[0] != TPKT


def is_session_begin(head: bytes) -> bool:
    return (head[0], head[5]) in ((_HANDSHAKE, 1), (TPKT, _CR))


def _unit_size(head: bytes) -> int:
    """Return the size of a unit, or 0 for other bytes. TLS is RFC 8446, 5.1, ISO-on-TCP is RFC 1006, 6."""
    if is_tls_head(head):
        size = int.from_bytes(head[3:5], "big") + 5
        fits = head[0] in (_HANDSHAKE, _ALERT, _DATA, _CHANGE_CIPHER) and head[1] == 3 and 1 <= head[2] <= 4
        return size if fits and 5 < size <= 18_500 else 0
    size = int.from_bytes(head[2:4], "big")
    fits = not head[1] and 2 <= head[4] <= size - 5 and head[5] & 0xF0 in (_CR, _CC, _DR, _DT)
    return size if fits else 0


def is_http(line: LineFacts) -> bool:
    """Return whether an end begins with a request, or a response, of HTTP/1."""
    return any(_HTTP.match(way.content) for way in (line.to_plc, line.from_plc))


def _first_write(flow: DirectionFacts) -> SegmentFacts | None:
    return flow.writes[0] if flow.writes else None


def _read_cotp(content: bytes | bytearray) -> tuple[int, bytes] | None:
    """Return the kind of the first COTP packet and its bytes."""
    if len(content) < 7 or content[0] != 3 or content[1] or content[4] > 0xFE:
        return None
    size = int.from_bytes(content[2:4], "big")
    kind = content[5] & 0xF0
    return (kind, bytes(content[:size])) if 7 <= size <= 8192 and kind in (_CR, _CC, _DR) else None


def _describe_tsaps(packet: bytes) -> str:
    at, end, found = 11, min(len(packet), packet[4] + 5), {}
    while at + 2 <= end:
        found[packet[at]] = packet[at + 2 : at + 2 + packet[at + 1]]
        at += 2 + packet[at + 1]
    texts = [
        f"{name} {found[key].hex('.').upper()}"
        for key, name in ((0xC1, "from TSAP"), (0xC2, "to TSAP"))
        if key in found
    ]
    return " ".join(texts)


def judge_wrong_tsap(line: LineFacts) -> Finding | None:
    """Judge whether the listener refuses the TSAPs of the caller."""
    asked = _read_cotp(line.caller.content)
    if line.protocol != "tcp" or asked is None or asked[0] != _CR:
        return None
    answer = _read_cotp(line.listener.content)
    way = "to-plc" if line.plc_calls else "from-plc"
    texts = [f"connection request {_describe_tsaps(asked[1])}".rstrip()]
    if answer is not None and answer[0] == _DR:
        reason = answer[1][10] if len(answer[1]) > 10 else 0
        texts.append(f"answered by a disconnect request (reason: {_REASONS.get(reason, reason)})")
        return Finding(0.97, tuple(texts), way=way, at=_first_write(line.listener), is_fact=True)
    end = line.end
    if not line.listener.writes and end is not None and line.caller.segments <= 2:
        is_listener = end.by_plc != bool(line.plc_calls)
        if is_listener:
            texts.append(f"answered by {end.kind.upper()} alone")
            return Finding(0.75, tuple(texts), way=way, at=SegmentFacts(end.ns, 0, 0, end.packet))
    return None


def judge_plain_tcp(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    content = line.to_plc.content
    if receiver is None or not receiver.is_whole or line.protocol != "tcp" or not line.has_begin:
        return None
    if not content or content[0] == TPKT:
        return None
    letter = f" ({chr(content[0])!r})" if 0x20 <= content[0] < 0x7F else ""
    texts = (
        f"the partner's first byte is {content[0]:02X}{letter}, but ISO-on-TCP begins with 03: the partner "
        "speaks plain TCP",
        f"the CONNECT {receiver.connect} speaks ISO-on-TCP (RFC 1006)",
    )
    at = _first_write(line.to_plc)
    return Finding(0.97, texts, "to-plc", at, receiver.instance, is_fact=True, is_remark=is_http(line))


def _tls_records(content: bytes | bytearray) -> list[tuple[int, bytes]]:
    found: list[tuple[int, bytes]] = []
    at = 0
    while at + 5 <= len(content) and len(found) < 64:
        kind, major, size = content[at], content[at + 1], int.from_bytes(content[at + 3 : at + 5], "big")
        if kind not in (_HANDSHAKE, _ALERT, _DATA, _CHANGE_CIPHER) or major != 3 or size > 18_500:
            break
        found.append((kind, bytes(content[at + 5 : at + 5 + size])))
        at += 5 + size
    return found


def judge_tls(line: LineFacts) -> Finding | None:
    """Judge whether the TLS handshake failed: with an alert, or because the connection ended in it."""
    if line.protocol != "tcp" or not (line.to_plc.content or line.from_plc.content):
        return None
    both = {"to-plc": _tls_records(line.to_plc.content), "from-plc": _tls_records(line.from_plc.content)}
    if not any(both.values()):
        return None
    hello = next((way for way, records in both.items() if records and _is_client_hello(*records[0])), None)
    if (hello is None and not line.has_begin) or _is_handshake_complete(both):
        return None  # the handshake is not in the capture, or succeeded
    for way, records in both.items():
        is_open = True  # not encrypted yet
        for kind, body in records:
            is_open = is_open and kind != _CHANGE_CIPHER
            if kind == _DATA:
                break
            if kind != _ALERT or (len(body) == 2 and body[1] == 0):
                continue
            flow = line.to_plc if way == "to-plc" else line.from_plc
            side = "the partner" if way == "to-plc" else "the PLC end"
            if len(body) == 2 and body[0] in (1, 2):
                name = _ALERTS.get(body[1], "alert")
                whose = "the PLC end" if way == "to-plc" else "the partner"
                means = f": {_MEANINGS[body[1]]}".format(other=whose) if body[1] in _MEANINGS else ""
                text = f"TLS alert {body[1]} ({name}) from {side}{means}"
                note = () if hello else ("the other end does not speak TLS",)
                return Finding(0.97, (text, *note), way=way, at=_first_write(flow), is_fact=True)
            if hello is not None and (not is_open or len(body) > 2):
                return Finding(0.85, (f"{side} sent an encrypted TLS alert before any data",), way=way)
    if hello is None or line.end is None:
        return None
    answer = both["from-plc" if hello == "to-plc" else "to-plc"]
    other = line.from_plc if hello == "to-plc" else line.to_plc
    end = SegmentFacts(line.end.ns, 0, 0, line.end.packet)
    side = "the PLC end" if line.end.by_plc else "the partner"
    if not answer:
        what = "bytes that are no TLS" if other.content else f"{line.end.kind.upper()} of {side}"
        return Finding(0.85, (f"a TLS ClientHello was answered by {what}",), way=hello, at=end)
    data = sum(kind == _DATA and len(body) > 40 for records in both.values() for kind, body in records)
    asked = both[hello]
    if not any(kind == _DATA for kind, _ in asked) and not (len(asked) > 2 and data):
        return Finding(0.8, (f"{side} ended the connection inside the TLS handshake",), at=end)
    sent = [len(body) for kind, body in asked if kind == _DATA]
    if len(sent) == 1 and sent[0] < 40 and line.end.by_plc == (hello == "from-plc"):
        text = f"{side} ended the connection with an encrypted alert in the handshake"
        return Finding(0.75, (text,), at=end)
    if _is_finish_refused(asked, answer, line, hello):
        side = "the PLC end" if hello == "to-plc" else "the partner"
        text = f"{side} answered the end of the handshake with one encrypted alert, nothing more"
        return Finding(0.75, (text,), way="from-plc" if hello == "to-plc" else "to-plc", at=end)
    return None


def _is_handshake_complete(both: dict[str, list[tuple[int, bytes]]]) -> bool:
    """Return whether a handshake up to TLS 1.2 succeeded: both ends encrypt, or one does and data came."""
    kinds = [[kind for kind, _ in records] for records in both.values()]
    ready = [_CHANGE_CIPHER in each and _HANDSHAKE in each[each.index(_CHANGE_CIPHER) :] for each in kinds]
    return all(ready) or (any(ready) and any(_DATA in each for each in kinds))


def _is_client_hello(kind: int, body: bytes) -> bool:
    return kind == _HANDSHAKE and body[:1] == b"\x01"  # 1: ClientHello, 2: ServerHello


def _is_finish_refused(
    asked: list[tuple[int, bytes]], answer: list[tuple[int, bytes]], line: LineFacts, hello: str
) -> bool:
    caller, listener = (line.to_plc, line.from_plc) if hello == "to-plc" else (line.from_plc, line.to_plc)
    if len(caller.writes) != 2 or not listener.writes or len(asked[-1][1]) <= _ENCRYPTED_ALERT:
        return False
    last = sum(write.size for write in listener.writes if write.ns >= caller.writes[1].ns)
    kind, body = answer[-1]
    return kind == _DATA and len(body) == _ENCRYPTED_ALERT == last - 5


def judge_serial_errors(line: LineFacts) -> Finding | None:
    for flow, way in ((line.to_plc, "to-plc"), (line.from_plc, "from-plc")):
        errors = flow.line_errors
        if errors:
            amount = sum(errors.values())
            kinds = ", ".join(f"{kind} {often}" for kind, often in errors.most_common())
            text = f"{count(amount, 'line error')} in {count(flow.bytes, 'byte')}: {kinds}"
            sure = 0.95 if amount > 2 else 0.8
            return Finding(sure, (text,), way=way, at=flow.first_of("line error"), is_fact=True)
    return None
