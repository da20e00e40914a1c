"""Printing from the command line: a port by name, the embedded machine among them, and one program through it."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from trunnion_core.profile import MachineProfile
from trunnion_host.port import Port, open_port
from trunnion_host.stream import Progress, StreamResult, stream_file
from trunnion_sim.firmware.embedded import EmbeddedPort
from trunnion_sim.firmware.machine import SoftwareMachine


@contextmanager
def open_printer(port: str, profile: MachineProfile, baud: int | None = None) -> Iterator[Port]:
    """The printer at `port` (a device, a pty, tcp://HOST:PORT), or `sim`: the embedded machine, as fast as possible.

    Raises StreamError where the port is missing, busy or refused.
    """
    printer: Port
    if port == "sim":
        printer = EmbeddedPort(SoftwareMachine(profile, speed=None))
    else:
        printer = open_port(port, baud or profile.planner.baud)
    try:
        yield printer
    finally:
        printer.close()


def print_program(
    program: Path,
    printer: Port,
    profile: MachineProfile,
    *,
    progress: Callable[[float, str], None] | None = None,
    on_warning: Callable[[str], None] | None = None,
    stop: threading.Event | None = None,
) -> StreamResult:
    """Stream a program; returns when the motion is over or the print stopped, with the reason.

    `progress` is told the executed share and a note, `on_warning` what is wrong and no reason to stop: the
    printer (a Marlin) has other steps per unit than the profile, or left filament out. Setting `stop` ends the
    print cleanly.
    """
    show = progress or (lambda _share, _note: None)

    def told(state: Progress) -> None:
        show(state.executed / max(state.total, 1), f"line {state.executed} of {state.total}")

    asked = profile.letters if profile.firmware.startswith("marlin") else ()
    steps = dict(zip(asked, profile.steps_per_shown.tolist(), strict=False))
    return stream_file(program, printer, on_progress=told, on_warning=on_warning, stop=stop, steps=steps)
