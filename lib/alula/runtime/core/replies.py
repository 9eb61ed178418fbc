"""The engine's answers to requests that it may refuse."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TransitionReply:
    """Answer to an extern transition or an event.

    ``reason`` is empty when it is accepted; ``state`` is the resource's state afterwards, empty for an event and when there is no
    such resource.
    """

    accepted: bool
    reason: str
    state: str


@dataclass(frozen=True)
class PauseReply:
    """Answer to a pause or a resumption; ``reason`` is empty when it is accepted."""

    accepted: bool
    reason: str = ""
