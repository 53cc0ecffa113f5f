"""What a rule of the doctor offers as a remedy, and how the remedy can be tried."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from trcvtui.capture.quality import CaptureLimit
from trcvtui.diagnosis.line_facts import SegmentFacts
from trcvtui.diagnosis.receiver import Receiver
from trcvtui.snapshots.doctor import Finding, Remedy


class CauseRule(NamedTuple):
    """One row. A found cause in `silenced_by` explains this cause.

    A found cause in `weakened_by` may explain this cause.
    If a capture has a quality in `blind`, the rule cannot judge the capture.
    """

    cause: str
    judge: Callable[..., Finding | None]  # takes a LineCase, in FRAME_RULES line and receiver
    silenced_by: tuple[str, ...] = ()
    weakened_by: tuple[str, ...] = ()
    blind: tuple[CaptureLimit, ...] = ()


class RemedyOffer(NamedTuple):
    """The remedies. `cured` is the receiver after all remedies, or None if the remedies cannot be tried.

    If the trial of `cured` fails, the remedies in `otherwise` are offered.
    """

    mend: tuple[Remedy, ...] = ()
    cured: Receiver | None = None
    otherwise: tuple[Remedy, ...] = ()


NO_OFFER: Final = RemedyOffer()


def finding_to_plc(
    receiver: Receiver, sure: float, texts: tuple[str, ...], at: SegmentFacts | None,
    offer: RemedyOffer = NO_OFFER, is_remark: bool = False,
) -> Finding:  # fmt: skip
    return Finding(sure, texts, "to-plc", at, receiver.instance, offer.mend, is_remark, trial=offer)


def offer_frame_reset(receiver: Receiver) -> tuple[Remedy, ...]:
    """Return COM_RST as the remedy after a change of length, or () if the receiver cannot use COM_RST."""
    text = "pulse COM_RST: then the next frame begins with a message"
    is_stream = receiver.has_reset and not receiver.is_datagram
    return (Remedy(text, f"pulse {receiver.instance} COM_RST"),) if is_stream else ()
