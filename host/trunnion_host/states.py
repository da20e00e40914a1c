"""Where a stream can be, and from where to where it may go."""

from enum import Enum, auto


class State(Enum):
    """Where the stream is."""

    GREETING = auto()
    """Numbers are being agreed on; nothing of the program was sent."""
    STREAMING = auto()
    """Lines go out as the window allows."""
    RESYNC = auto()
    """A line is asked for again; waiting until the wire is quiet."""
    STOPPING = auto()
    """The program is abandoned; the farewell is being sent."""
    DONE = auto()
    """Every line was executed."""
    STOPPED = auto()
    """It ended earlier; `reason` says why."""


LEGAL: dict[State, frozenset[State]] = {
    State.GREETING: frozenset({State.STREAMING, State.STOPPED}),
    State.STREAMING: frozenset({State.RESYNC, State.STOPPING, State.DONE, State.STOPPED}),
    State.RESYNC: frozenset({State.STREAMING, State.STOPPING, State.STOPPED}),
    State.STOPPING: frozenset({State.STOPPED}),
    State.DONE: frozenset(),
    State.STOPPED: frozenset(),
}
