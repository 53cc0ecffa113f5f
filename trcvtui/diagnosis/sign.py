"""What a rule of the doctor says: how sure, where, the evidence, what mends it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from trcvtui.diagnosis.line_facts import SegmentFacts

if TYPE_CHECKING:
    from trcvtui.blocks.conditions import Condition
    from trcvtui.diagnosis.receiver import Receiver


class Remedy(NamedTuple):
    """One remedy in words; as a bench command, as `--set` of a what-if, None: it is none.

    `is_tried`: the evidence was judged again with it, and nothing was left. Any other one is advice.
    """

    text: str
    command: str | None = None
    set: str | None = None
    is_tried: bool = False


class Sign(NamedTuple):
    """What speaks for a cause; `way` is to-plc or from-plc, None: both. `mend`: () is that of the row.

    A remark is worth knowing, and no fault; a fact is proved by the protocol. `cured`: the receiver as it is
    with all of `mend`; None: it cannot be tried. `otherwise` is offered where the trial fails.
    """

    confidence: float
    evidence: tuple[str, ...]
    way: str | None = None
    at: SegmentFacts | None = None
    instance: str | None = None
    mend: tuple[Remedy, ...] = ()
    is_remark: bool = False
    is_fact: bool = False
    cured: Receiver | None = None
    otherwise: tuple[Remedy, ...] = ()
    packets: tuple[int, ...] = ()  # numbers in the capture, beside that of `at`
    status: tuple[int, ...] = ()  # what the blocks show for it; (): what it leads to
    leads_to: tuple[Condition, ...] | None = None  # in place of what the cause leads to
    filter: str = ""  # for Wireshark, in place of that of the cause


class RemedyOffer(NamedTuple):
    """What a rule offers, and the receiver as it would be with all of it; None: it cannot be tried.

    `otherwise` is offered where the trial fails.
    """

    mend: tuple[Remedy, ...] = ()
    cured: Receiver | None = None
    otherwise: tuple[Remedy, ...] = ()


NO_OFFER: Final = RemedyOffer()


def sign_to_plc(
    receiver: Receiver,
    sure: float,
    texts: tuple[str, ...],
    at: SegmentFacts | None,
    offer: RemedyOffer = NO_OFFER,
) -> Sign:
    """Return what speaks for a cause in what the partner says to a receiver."""
    return Sign(
        sure,
        texts,
        "to-plc",
        at,
        receiver.instance or None,
        offer.mend,
        cured=offer.cured,
        otherwise=offer.otherwise,
    )


def frames_anew(receiver: Receiver) -> tuple[Remedy, ...]:
    """Return what lets frames begin with a message after their length has changed."""
    text = "COM_RST: the next frame then begins with a message"
    is_stream = receiver.has_reset and not receiver.is_datagram
    return (Remedy(text, f"pulse {receiver.instance} COM_RST"),) if is_stream else ()
