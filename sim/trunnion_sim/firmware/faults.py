"""Faults on command: what goes wrong, and when, as text and as a value.

A spec is `KIND` or `KIND:key=value,key=value`. When: `line=N` (the N-th line on that wire; for firmware kinds the N-th
command), `time=S` (the first chance from S simulated seconds on), `p=P` (each line with probability P), `bytes=N` (wire
kinds: each byte with probability 1/N). Without a when it is `line=1`. `times=N` ends it after N times: 1 by default
with line and time, no end with p and bytes. Other keys belong to a kind and are listed in KINDS.
"""

import math
from dataclasses import dataclass, field

from trunnion_core.errors import TrunnionError
from trunnion_core.validation import nearest

WHEN = ("line", "time", "p", "bytes")


class FaultError(TrunnionError):
    """A fault spec that cannot be read."""


@dataclass(frozen=True)
class Kind:
    """A kind of fault: where it strikes, what it does, and its own keys with their defaults."""

    where: str
    """up, down, ok (lines of answer that begin with ok), or firmware."""
    help: str
    keys: dict[str, float | str] = field(default_factory=dict)


KINDS: dict[str, Kind] = {
    "flip-up": Kind("up", "one bit of a byte to the firmware is flipped"),
    "drop-up": Kind("up", "one byte to the firmware is lost"),
    "newline-up": Kind("up", "the end of a line to the firmware is lost"),
    "lose-up": Kind("up", "a line to the firmware is lost"),
    "cut-up": Kind("up", "only the first half of a line arrives, without its end"),
    "noise-up": Kind("up", "bytes above 0x7f arrive before a line", {"size": 20.0}),
    "flip-down": Kind("down", "one bit of a byte to the host is flipped"),
    "drop-down": Kind("down", "one byte to the host is lost"),
    "noise-down": Kind("down", "bytes above 0x7f are sent before a line", {"size": 20.0}),
    "lose-down": Kind("down", "a line to the host is lost"),
    "cut-down": Kind("down", "only the first half of a line is sent, without its end"),
    "lose-ok": Kind("ok", "an ok is lost"),
    "double-ok": Kind("ok", "an ok is sent twice"),
    "merge-ok": Kind("ok", "an ok loses its line end and runs into the next line"),
    "split-ok": Kind("ok", "an ok is torn in two by a pause", {"seconds": 0.5}),
    "late-ok": Kind("ok", "an ok is held back, and all after it", {"seconds": 0.5}),
    "resend-old": Kind("firmware", "a line executed long since is asked for again", {"back": 3.0}),
    "resend-future": Kind("firmware", "a line not sent yet is asked for", {"ahead": 10.0}),
    "resend-next": Kind("firmware", "the line that comes next anyway is asked for"),
    "resend-no-ok": Kind("firmware", "from here on a Resend has no ok behind it"),
    "resend-late-ok": Kind("firmware", "from here on the ok behind a Resend is late", {"seconds": 0.5}),
    "resend-forever": Kind("firmware", "from here on every line is asked for again"),
    "reset": Kind("firmware", "the board restarts with its banner"),
    "reset-silent": Kind("firmware", "the board restarts and says nothing"),
    "kill": Kind("firmware", "the firmware halts"),
    "runaway": Kind("firmware", "a heater loses its power", {"heater": "nozzle"}),
    "maxtemp": Kind("firmware", "a heater's switch fuses shut", {"heater": "nozzle"}),
    "sensor-open": Kind("firmware", "a thermistor is interrupted (MINTEMP)", {"heater": "nozzle"}),
    "sensor-short": Kind("firmware", "a thermistor is shorted (MAXTEMP)", {"heater": "nozzle"}),
    "unplug": Kind("firmware", "the port is gone; back after seconds, or never with 0", {"seconds": 0.0}),
    "slow-busy": Kind("firmware", "a command takes long, and says so", {"seconds": 180.0}),
    "slow-silent": Kind("firmware", "a command takes long without a word", {"seconds": 30.0}),
    "ring": Kind("firmware", "from here on the receive ring is smaller", {"size": 32.0}),
    "steps": Kind("firmware", "the stored steps per unit are wrong by a factor", {"axis": "", "factor": 2.0}),
    "unreachable": Kind("firmware", "a move is dropped with an ok"),
    "pause": Kind("firmware", "the printer asks the host to pause"),
    "resume": Kind("firmware", "the printer asks the host to go on"),
    "cancel": Kind("firmware", "the printer asks the host to cancel"),
    "prompt": Kind("firmware", "the printer stops and waits for a person"),
}


@dataclass(frozen=True)
class Fault:
    """One fault: its kind, when it strikes, how often, and the kind's own values."""

    kind: str
    when: str
    at: float
    times: float
    values: dict[str, float | str]

    @property
    def where(self) -> str:
        """Where it strikes: up, down, ok or firmware."""
        return KINDS[self.kind].where

    def number(self, key: str) -> float:
        """One of the kind's numbers."""
        return float(self.values[key])

    def word(self, key: str) -> str:
        """One of the kind's words."""
        return str(self.values[key])


def parse_fault(spec: str) -> Fault:
    """The fault in `spec`. Raises FaultError with what would have been right."""
    name, _, tail = spec.partition(":")
    kind = KINDS.get(name.strip())
    if kind is None:
        raise FaultError(f"--fault '{spec}': no such fault; {nearest(name.strip(), KINDS)}")
    when, at, times = "line", 1.0, math.nan
    values = dict(kind.keys)
    for word in filter(None, (word.strip() for word in tail.split(","))):
        key, equals, text = word.partition("=")
        if not equals:
            raise FaultError(f"--fault '{spec}': '{word}' should be key=value")
        if key in WHEN:
            when, at = key, _number(spec, key, text)
        elif key == "times":
            times = _number(spec, key, text)
        elif key in values:
            values[key] = text if isinstance(values[key], str) else _number(spec, key, text)
        else:
            raise FaultError(f"--fault '{spec}': unknown key; {nearest(key, (*WHEN, 'times', *values))}")
    if when == "p" and at > 1:
        raise FaultError(f"--fault '{spec}': p is {at:g}, should be at most 1")
    if when == "bytes" and (kind.where == "firmware" or at < 1):
        raise FaultError(f"--fault '{spec}': bytes=N needs a fault of a wire and N of 1 or more")
    if values.get("heater", "nozzle") not in ("nozzle", "bed"):
        raise FaultError(f"--fault '{spec}': heater is {values['heater']}, should be nozzle or bed")
    if math.isnan(times):
        times = 1.0 if when in ("line", "time") else math.inf
    return Fault(name.strip(), when, at, times, values)


def _number(spec: str, key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= 0):
        raise FaultError(f"--fault '{spec}': {key} is '{text}', should be a number of 0 or more")
    return value
