"""The wire between host and firmware as a state machine: bytes and time come in, bytes and events go out.

Every line carries a number and a checksum, and the firmware takes a line only as the successor of the last one it took;
so what is executed is exact whatever happens to the oks. Oks only say when there is room. Nothing is ever sent again
on suspicion: a stream that stands still *asks*, with an M105 under a fresh number, which the firmware either takes
(then it had everything) or answers with the number that it misses. The answer to M105 is the only ok with temperatures
in it, so it also says how many oks went missing or came twice. Now and then, and at the end, it asks where the printer
stands: firmware drops a move that it cannot reach with an ok like any other.
"""

from collections import deque
from collections.abc import Mapping, Sequence

from trunnion_host.inspection import Inspection, Question
from trunnion_host.limits import Limits
from trunnion_host.line_log import LineLog
from trunnion_host.replies import Kind, Reader, Reply, temperatures
from trunnion_host.states import LEGAL, State
from trunnion_host.window import Window
from trunnion_host.wire import numbered

ASK = -1
"""In the log: an M105 that the host put between the program's lines."""
QUESTIONS = {Question.WHERE: -2, Question.STEPS: -3}
"""In the log: what the host asks the printer about itself."""
OWN = ("M105", Question.WHERE.value, Question.STEPS.value)
HEATERS_OFF = ("M104 S0", "M140 S0", "M107")
FAREWELL = ("M410", *HEATERS_OFF, "G91", "G1 Z5 F600", "G90")
"""Stop where it is, heaters off, away from the part."""


class Sender:
    """Streams `lines` (prepared commands) once, exactly. Call start, then receive and tick; each returns what to write.

    `executed` counts the program's lines that the firmware took; when the state is DONE it is all of them, and the
    motion is over. `heaters` holds the last report: letter to (actual, target) °C; `talk` what the firmware last said
    to people; `warnings` what is wrong and no reason to stop. `steps`, a letter to the motor steps per mm or degree
    that the profile has, is asked about first; leave it out for firmware that has no M503.
    """

    def __init__(
        self,
        lines: Sequence[str],
        limits: Limits | None = None,
        farewell: Sequence[str] = FAREWELL,
        steps: Mapping[str, float] | None = None,
    ) -> None:
        self.limits = limits or Limits()
        self.state = State.GREETING
        self.reason = ""
        self.heaters: dict[str, tuple[float, float | None]] = {}
        self.talk: deque[str] = deque(maxlen=200)
        self.resends = 0
        self.questions = 0
        self.executed = 0
        self.paused = False
        self._log = LineLog(lines, farewell, OWN)
        self._inspection = Inspection(steps)
        self._next_number = 1
        self._acked = 0
        self._last_needed = -1
        self._in_flight = Window(self.limits)
        self._slow = True
        self._asks: deque[int] = deque()
        self._owed: deque[int] = deque()
        self._answers_missing = False
        self._want_ask = False
        self._verified = 0
        self._answered_plainly = 0
        self._unanswered_asks = 0
        self._doubted = (0, 0)
        self._reader = Reader()
        self._out = bytearray()
        self._numbers_agreed = False
        self._line_refused = False
        self._now = self._since = self._heard = self._alive = self._moved = self._asked_at = self._where_at = 0.0

    @property
    def total(self) -> int:
        """Lines of the program."""
        return self._log.total

    @property
    def sent(self) -> int:
        """Lines of the program that went out at least once."""
        return min(self._log.next_line, self._log.total)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is wrong with the printer and no reason to stop, in the order in which it was noticed."""
        return tuple(self._inspection.warnings)

    @property
    def greeted(self) -> bool:
        """Whether a firmware ever answered."""
        return self._acked > 0

    @property
    def over(self) -> bool:
        """Whether nothing more will happen."""
        return self.state in (State.DONE, State.STOPPED)

    @property
    def patience(self) -> float:
        """Seconds that the caller may wait for bytes before the next tick."""
        return self.limits.quiet / 2 if self.state is State.RESYNC else 0.05

    def start(self, now: float) -> bytes:
        """Begin to agree on numbers."""
        self._now = self._since = self._heard = self._alive = self._moved = self._where_at = now
        self._greet()
        return self._taken()

    def receive(self, data: bytes, now: float) -> bytes:
        """Bytes that came from the firmware, in pieces of any size."""
        self._pass_time(now)
        if data:
            self._heard = now
        for reply in self._reader.take(data):
            if self.over:
                break
            self._reply(reply)
        self._feed()
        return self._taken()

    def tick(self, now: float) -> bytes:
        """Let time pass. Call at least every `patience` seconds."""
        self._pass_time(now)
        self._timers()
        self._feed()
        return self._taken()

    def stop(self, now: float, reason: str) -> bytes:
        """Abandon the program: stop feeding, stop the motion, heaters off, away from the part."""
        self._pass_time(now)
        self._abandon(reason)
        self._feed()
        return self._taken()

    # What the firmware says

    def _reply(self, reply: Reply) -> None:
        kind = reply.kind
        if kind is not Kind.NOISE:
            self._alive = self._now
        if kind is Kind.OK or kind is Kind.OK_REPORT:
            self._ok(reply)
        elif kind is Kind.RESEND and reply.number is not None:
            self._resend(reply.number)
        elif kind is Kind.BUSY:
            self._moved = self._now
        elif kind is Kind.REPORT:
            self.heaters.update(temperatures(reply.text))
        elif kind is Kind.POSITION:
            self._stands(reply.text)
        elif kind is Kind.START:
            self._restarted("it sent its start banner")
        elif kind is Kind.FATAL:
            self._end(f"the printer stopped by itself: {reply.text}")
        elif kind is Kind.ACTION:
            self._action(reply.text)
        elif kind is Kind.LINE_ERROR:
            self._line_refused = True
        elif kind is Kind.NOISE:
            self._want_ask |= self.state is State.STREAMING  # it may have been an ok
        elif reply.text:
            self.talk.append(reply.text)
            self._inspection.hear(reply.text)

    def _stands(self, text: str) -> None:
        """A position was reported; a printer that pauses goes where it likes."""
        if not self.paused:
            self._inspection.hear_position(text)
            if self._inspection.reason:
                self._abandon(self._inspection.reason)

    def _ok(self, reply: Reply) -> None:
        self._moved = self._now
        self._unanswered_asks = 0
        if reply.kind is Kind.OK_REPORT:
            self.heaters.update(temperatures(reply.text))
        if self.state is State.GREETING:
            self._greeting_ok(reply)
        elif reply.kind is Kind.OK_REPORT and (self._owed or self._asks):
            self._answer()
        elif reply.number is not None and self._acked < reply.number < self._next_number:
            self._believe(reply.number)
        elif self.state is not State.RESYNC:
            for _ in range(reply.count):
                self._one_ok()
        self._end_if_complete()

    def _answer(self) -> None:
        """A question was answered. Answers keep their order, so the oldest open question at least was taken.

        Only if no other question is open is it known which one this answers, and so how many lines are under way.
        """
        if self._owed:
            self._verified = max(self._verified, self._owed.popleft())
            return
        number = self._asks.popleft()
        self._verified = max(self._verified, number)
        if self._asks:
            self._answers_missing = True
            self._one_ok()
        else:
            self._settle(number)

    def _settle(self, number: int) -> None:
        """Counting starts afresh: the question `number` and all before it were taken."""
        self._slow = self._answers_missing = False
        self._doubted = (0, 0)
        self._asks.clear()
        self._believe(number)
        if self.state is State.RESYNC:
            self._to(State.STREAMING)

    def _one_ok(self) -> None:
        """The oldest line under way was taken, as far as counting goes."""
        if not self._in_flight:
            self._want_ask = True
            return
        number = self._in_flight.pop()
        if self._asks and number >= self._asks[0]:
            self._plain_answer(number)
        if self._acked < number < self._next_number:
            self._take(number)

    def _plain_answer(self, number: int) -> None:
        """A question was answered without temperatures: by a firmware that has none, or the answer was damaged."""
        self._slow = False
        if not self.heaters and number == self._asks[0]:
            self._answered_plainly = self._asks.popleft()
        elif number > self._asks[-1] + self.limits.window_lines:
            self._asks.clear()
            self._owed.clear()

    def _believe(self, number: int) -> None:
        """The firmware has taken everything up to `number`; what was sent after that is still under way."""
        self._next_number = max(self._next_number, number + 1)
        self._in_flight.restart((n, len(self._log.wire(n))) for n in range(number + 1, self._next_number))
        self._take(number)

    def _take(self, number: int) -> None:
        """Everything up to `number` counts as executed."""
        self._in_flight.taken(number)
        self.executed = max(self.executed, self._log.last_of_program(self._acked + 1, number))
        self._acked = number
        self._inspection.taken(number)

    def _resend(self, number: int) -> None:
        """The firmware misses a line, or says so."""
        self._line_refused = True
        if self.state is State.GREETING:
            return
        self._moved = self._now
        self._unanswered_asks = 0
        self.resends += 1
        count = self._in_flight.missed(number)
        if count >= self.limits.resends:
            what = (
                f"'{self._log.text(number)}'" if number < len(self._log) else f"number {number}, which was never sent"
            )
            self._end(f"the printer asked {count} times in a row for the line {what}")
        elif number > len(self._log):
            self._want_ask = True
        elif number == self._next_number:
            if self._in_flight.reaches(number):  # the answer to a question that overtook this line
                self._asks = deque(asked for asked in self._asks if asked < number)
                self._believe(number - 1)
        elif number <= self._acked:
            self._doubt(number)
        else:
            self._go_back(number)

    def _doubt(self, number: int) -> None:
        """A line that was taken, as far as is known, is asked for: ask back, and believe what is said again and again.

        A line known to have been taken cannot be missing from a firmware that still has its state.
        """
        times = self._doubted[1] + 1 if self._doubted[0] == number else 1
        self._doubted = (number, times)
        gone = number <= max(self._verified, self._acked - self.limits.memory)
        if gone and times >= 3:
            self._restarted(f"it asks for line number {number} though it had taken {self._acked}")
        elif not gone and times >= 2:
            self._go_back(number)
        else:
            self._ask()

    def _go_back(self, number: int) -> None:
        """Send from `number` on again, one line at a time until a question is answered."""
        self._doubted = (0, 0)
        self._take(number - 1)
        self._next_number = number
        self._in_flight.lost(number)
        self._owed.extend(asked for asked in self._asks if asked < number)
        self._asks.clear()
        self._slow = self._want_ask = True
        if self.state is State.STREAMING:
            self._to(State.RESYNC)
            self._since = self._now

    def _restarted(self, how: str) -> None:
        """Its state is gone: nothing may move any more. Heaters are off after a restart; that is said all the same."""
        if self.state is State.GREETING:
            self._numbers_agreed = False
            self._asked_at = self._now - self.limits.greeting_retry + self.limits.boot
            return
        self._end(f"the printer restarted: {how}")
        self._out += b"".join(b"\n%b" % line.encode("ascii") for line in HEATERS_OFF) + b"\n"

    def _action(self, text: str) -> None:
        self.talk.append(text)
        word = text.removeprefix("action:").strip()
        if word == "cancel":
            self._abandon("cancelled at the printer")
        elif word in ("pause", "paused", "resume", "resumed"):
            self.paused = word.startswith("pause")

    # Agreeing on numbers

    def _greet(self) -> None:
        """Number 0 for the firmware's count; the newline ends whatever stands in its buffer."""
        self._asked_at = self._now
        self._numbers_agreed = self._line_refused = False
        self._out += b"\n" + numbered(0, "M110 N0")

    def _greeting_ok(self, reply: Reply) -> None:
        """First the ok of M110, then that of the first numbered line, which proves the numbering."""
        if self._line_refused:
            self._greet()
        elif not self._numbers_agreed:
            self._numbers_agreed = True
            self._asked_at = self._now
            self._out += self._log.wire(1)
        else:
            self._acked, self._next_number = 1, 2
            self._verified = 1 if reply.kind is Kind.OK_REPORT else 0
            self._asked_at = self._now
            self._to(State.STREAMING)
            self._slow = False

    # Time

    def _pass_time(self, now: float) -> None:
        """Move the clock; a gap in which the host slept is no silence of the printer."""
        gap = now - self._now
        if gap > self.limits.jump:
            for name in ("_since", "_heard", "_alive", "_moved", "_asked_at", "_where_at"):
                setattr(self, name, getattr(self, name) + gap)
        self._now = now

    def _timers(self) -> None:
        """What happens because nothing happened."""
        limits, now = self.limits, self._now
        if self.over:
            return
        self._inspection.due |= now - self._where_at > limits.where
        if self.state is State.GREETING:
            if now - self._since > limits.greeting:
                self._end(f"nothing that speaks G-code answered within {limits.greeting:g} s")
            elif now - self._asked_at > limits.greeting_retry:
                self._greet()
            return
        if self.state is State.STOPPING and now - self._since > limits.farewell:
            self._end(f"{self.reason}; the printer did not confirm that its heaters are off")
        elif now - self._alive > limits.silence:
            self._end(f"the printer has been silent for {limits.silence:g} s")
        elif self.state is State.RESYNC:
            if now - self._heard >= limits.quiet or now - self._since > limits.resync:
                self._to(State.STREAMING)
        elif self._answers_missing and self._asks and now - self._heard >= limits.answers:
            self._settle(self._asks[-1])  # answers come together; what has not come by now is lost
            self._end_if_complete()
        elif self._stalled():
            self._unanswered_asks += 1
            self._ask()
        elif now - self._asked_at > limits.poll:
            self._want_ask = True

    def _stalled(self) -> bool:
        """Whether an answer is overdue and the wire can take one more question."""
        waiting = bool(self._in_flight or self._asks)
        patience = self.limits.ask_after * 2**self._unanswered_asks
        overdue = self._now - max(self._moved, self._asked_at) > patience
        return waiting and overdue and self._unanswered_asks < self.limits.asks

    # What goes out

    def _feed(self) -> None:
        """Send what the window has room for."""
        if self.state not in (State.STREAMING, State.STOPPING):
            return
        lines = 1 if self._slow else self._in_flight.room
        while len(self._in_flight) < lines:
            number = self._next_number
            new = number == len(self._log)
            if new:
                index = self._next_index()
                if index is None:
                    break
                self._log.append(index)
            wire = self._log.wire(number)
            if not self._in_flight.takes(len(wire)):
                if new:
                    self._log.pop()
                break
            if new:
                self._first_sent(number)
            self._next_number = number + 1
            self._send(number, wire)

    def _next_index(self) -> int | None:
        """What gets the next number: a question that is due, else a line of the program, else nothing."""
        log = self._log
        if self._want_ask and not self._asks:
            return ASK
        at_end = log.next_line >= log.end
        if self.state is State.STREAMING:
            if self.paused or self._inspection.waiting:
                return None
            question = self._inspection.next(at_end)
            if question:
                return QUESTIONS[question]
        return None if at_end else log.next_line

    def _first_sent(self, number: int) -> None:
        """What follows from a line going out for the first time."""
        index = self._log[number]
        if index >= 0:
            self._log.next_line = index + 1
            self._inspection.follow(self._log.text(number))
        elif index != ASK:
            self._where_at = self._now
            self._inspection.ask(Question(self._log.text(number)), number)

    def _ask(self) -> None:
        """An M105 under a fresh number, though the window is full; the newline ends a line that lost its own."""
        number = len(self._log)
        self._log.append(ASK)
        self._out += b"\n"
        if self._next_number == number:
            self._next_number = number + 1
        self._slow = True
        self._send(number, self._log.wire(number))

    def _send(self, number: int, wire: bytes) -> None:
        if not self._in_flight:
            self._moved = self._now
        if self._log[number] == ASK:
            self._asks.append(number)
            self._asked_at, self._want_ask = self._now, False
            self.questions += 1
        elif self._log[number] == self._log.end - 1:
            self._last_needed = number
        self._out += wire
        self._in_flight.push(number, len(wire))

    def _taken(self) -> bytes:
        out, self._out = self._out, bytearray()
        return bytes(out)

    # How it ends

    def _end_if_complete(self) -> None:
        """Over when the firmware is known to have taken the last number, not merely when enough oks came."""
        if self._last_needed < 0 or self._in_flight or self._next_number < len(self._log):
            return
        if self.state is State.STREAMING and not self._inspection.current:
            return
        if max(self._verified, self._answered_plainly) > self._last_needed:
            if self.state is State.STREAMING:
                self._to(State.DONE)
            elif self.state is State.STOPPING:
                self._end(self.reason)
        elif not self._asks:
            self._want_ask = True

    def _abandon(self, reason: str) -> None:
        if self.state is State.GREETING:
            self._end(reason)
        elif self.state in (State.STREAMING, State.RESYNC):
            self._to(State.STOPPING)
            self.reason = reason
            self._since = self._now
            self._log.say_farewell()
            self._last_needed = -1
            self._slow = self._want_ask = True
            self._out += b"\nM108\nM410\n"

    def _end(self, reason: str) -> None:
        if not self.over:
            self._to(State.STOPPED)
            self.reason = reason

    def _to(self, state: State) -> None:
        if state not in LEGAL[self.state]:
            raise RuntimeError(f"{self.state.name} cannot become {state.name}")
        self.state = state
