"""A G-code file becomes a print: the protocol's bytes over a real port, in real time."""

import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from trunnion_core.errors import StreamError
from trunnion_host.limits import Limits
from trunnion_host.port import Port
from trunnion_host.prepare import commands
from trunnion_host.protocol import FAREWELL, Sender
from trunnion_host.states import State

REPORT_EVERY = 0.1
"""s between two calls of on_progress."""


@dataclass(frozen=True)
class Progress:
    """How far a print is. Counts are commands of the program, without comments; heaters: letter to (actual, target)."""

    executed: int
    total: int
    heaters: dict[str, tuple[float, float | None]]


@dataclass(frozen=True)
class StreamResult:
    """How a print ended. `reason` is empty when every command was executed and the motion is over.

    `warnings` say what was wrong with the printer and no reason to stop.
    """

    sent: int
    executed: int
    reason: str
    resends: int
    questions: int
    warnings: tuple[str, ...]


def stream_file(
    program: Path | Iterable[str],
    port: Port,
    *,
    on_progress: Callable[[Progress], None] | None = None,
    on_warning: Callable[[str], None] | None = None,
    stop: threading.Event | None = None,
    steps: Mapping[str, float] | None = None,
    limits: Limits | None = None,
    farewell: Sequence[str] = FAREWELL,
    clock: Callable[[], float] = time.monotonic,
) -> StreamResult:
    """Print a file, or lines of G-code, once and exactly; returns when the motion is over or the print stopped.

    When `stop` is set feeding ends, then the motion, the heaters go off and the tool leaves (`farewell`). `steps`, a
    letter to motor steps per mm or degree, is what the firmware should say it has; a difference is a warning. Raises
    StreamError when the file cannot be read or sent, or nothing answers at the port; whatever happens once the print
    has begun is a reason in the result.
    """
    sender = Sender(commands(_lines(program)).text, limits, farewell, steps)
    try:
        _exchange(sender, port, on_progress, on_warning, stop or threading.Event(), clock)
        reason = sender.reason
    except OSError as error:
        reason = str(error) or "the port is gone"
    else:
        if sender.state is State.STOPPED and not sender.greeted and not (stop and stop.is_set()):
            raise StreamError(reason)
    return StreamResult(sender.sent, sender.executed, reason, sender.resends, sender.questions, sender.warnings)


def _exchange(
    sender: Sender,
    port: Port,
    on_progress: Callable[[Progress], None] | None,
    on_warning: Callable[[str], None] | None,
    stop: threading.Event,
    clock: Callable[[], float],
) -> None:
    """Carry bytes to and fro until the stream is over."""
    told = -REPORT_EVERY
    warned = 0
    stopping = False
    out = sender.start(clock())
    while True:
        if out:
            port.write(out)
        now = clock()
        if on_progress is not None and (now - told >= REPORT_EVERY or sender.over):
            told = now
            on_progress(Progress(sender.executed, sender.total, dict(sender.heaters)))
        if on_warning is not None:
            for warning in sender.warnings[warned:]:
                on_warning(warning)
            warned = len(sender.warnings)
        if sender.over:
            return
        if stop.is_set() and not stopping:
            stopping = True
            out = sender.stop(now, "stopped on request")
            continue
        data = port.read(sender.patience)
        out = sender.receive(data, clock()) if data else b""
        out += sender.tick(clock())


def _lines(program: Path | Iterable[str]) -> Iterable[str]:
    if not isinstance(program, Path):
        return program
    try:
        return program.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise StreamError(f"{program}: cannot be read: {error.strerror}") from None
