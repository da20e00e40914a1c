"""What the wire and the firmware can take, and how long the host waits for what."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Lines, bytes, seconds."""

    window_lines: int = 4
    """Under way at once: Marlin's BUFSIZE."""
    window_bytes: int = 128
    """Under way at once: Marlin's receive ring."""
    quiet: float = 0.03
    """Without a byte for so long after a Resend, everything about the lost lines has arrived."""
    resync: float = 0.5
    """After so long a Resend is served though the printer keeps talking."""
    ask_after: float = 0.8
    """Without an ok or a sign of work for so long, ask; again after twice as long each time."""
    answers: float = 0.15
    """Without a byte for so long after the answer to one of several questions, the others' answers are lost."""
    asks: int = 4
    """Unanswered questions at once: together they fit the receive ring."""
    silence: float = 120.0
    """Without any sign of life for so long, give up. Firmware without busy messages may be silent for a long move."""
    greeting: float = 20.0
    """Until the first answer: boards boot when a port is opened."""
    greeting_retry: float = 1.5
    boot: float = 0.3
    """From a start banner to the first line that the board will read."""
    farewell: float = 15.0
    """For the printer to confirm that it stopped."""
    poll: float = 2.0
    """Between questions for the temperatures."""
    where: float = 10.0
    """Between questions for the position. Old firmware waits for all motion to end before it answers."""
    resends: int = 12
    """Of the same line, before giving up."""
    crowded: int = 100
    """Five Resends within so many lines make the window a line smaller,"""
    calm: int = 1000
    """and so many lines without one make it a line larger again."""
    memory: int = 24
    """Lines below the last acknowledged one that a working firmware can have any reason to ask for."""
    jump: float = 5.0
    """A longer gap between two calls means that the host slept, not the printer."""
