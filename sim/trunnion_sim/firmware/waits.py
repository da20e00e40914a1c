"""What a running command waits for."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Wait:
    """A command goes on when `ready` says so, or the clock reaches `until`."""

    until: float = math.inf
    ready: Callable[[], bool] | None = None
    busy: str = "processing"
    """What the firmware says every two seconds; empty for nothing."""
    user: bool = False
    """Whether only a person can end it: time alone never does."""


Steps = Iterator[Wait]
"""A command that takes time: each Wait is a place where it pauses."""
