"""Stream 100,000 short lines to the embedded machine over a good and a bad wire; print what it took.

python bench/streaming.py [LINES]
"""

import sys
import time

from trunnion_core.profile import load_profile
from trunnion_host.protocol import Sender
from trunnion_host.stream import stream_file
from trunnion_sim.firmware.embedded import EmbeddedPort
from trunnion_sim.firmware.faults import parse_fault
from trunnion_sim.firmware.machine import SoftwareMachine


def main(count: int) -> None:
    lines = ["G28", *(f"G1 X{i % 997 / 25:.3f} Y{i % 613 / 16:.3f} A{i % 89 / 9:.3f} F6000" for i in range(count - 1))]
    started = time.process_time()
    answer_everything(lines)
    print(f"host alone: {(time.process_time() - started) / count * 1e6:.1f} us CPU a line")
    for faults in ((), ("flip-up:p=0.001", "drop-up:p=0.001")):
        machine = SoftwareMachine(
            load_profile("generic_ab_cradle"), speed=None, faults=[parse_fault(fault) for fault in faults], seed=1
        )
        clock, started = time.perf_counter(), time.process_time()
        result = stream_file(lines, EmbeddedPort(machine))
        clock, used = time.perf_counter() - clock, time.process_time() - started
        ran = [line for line in machine.executed if not line.startswith(("M105", "M110", "M114", "M400", "M503"))]
        print(
            f"{', '.join(faults) or 'good wire'}: {count} lines in {clock:.1f} s ({used:.1f} s CPU, host and machine), "
            f"{result.resends} resends, executed equals sent: {ran == lines}"
        )


def answer_everything(lines: list[str]) -> None:
    """A firmware that says ok to every line at once."""
    sender = Sender(lines)
    now = 0.0
    out = sender.start(now)
    while not sender.over:
        now += 1e-4
        out = sender.receive(b"ok\n" * sum(1 for line in out.split(b"\n") if line), now)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
