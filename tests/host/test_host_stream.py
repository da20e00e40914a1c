"""Whole prints through real ports: the embedded machine, a pty, a socket; and ports that are not there."""

import os
import socket
import threading
import tty
from pathlib import Path

import numpy as np
import pytest

from trunnion_core.errors import StreamError
from trunnion_core.profile import load_profile
from trunnion_host.limits import Limits
from trunnion_host.port import open_port
from trunnion_host.stream import Progress, stream_file
from trunnion_sim.firmware.embedded import EmbeddedPort
from trunnion_sim.firmware.faults import parse_fault
from trunnion_sim.firmware.machine import SoftwareMachine

PROFILE = load_profile("generic_ab_cradle")


def program(rows: int, seed: int = 0) -> list[str]:
    """Short moves of all five joints, no two lines alike."""
    at = np.random.default_rng(seed).normal(0, 0.1, (rows, 2)).cumsum(axis=0)
    at = 40 * np.sin(at / 40)
    return [
        "G28",
        *(f"G1 X{x:.4f} Y{y:.4f} A{x / 8:.4f} B{y / 9:.4f} F{6000 + i % 97}" for i, (x, y) in enumerate(at.tolist())),
    ]


def executed(machine: SoftwareMachine) -> list[str]:
    return [line for line in machine.executed if not line.startswith(("M105", "M110", "M114", "M400", "M503"))]


def machine(*faults: str, seed: int = 5) -> SoftwareMachine:
    return SoftwareMachine(PROFILE, speed=None, faults=[parse_fault(fault) for fault in faults], seed=seed)


def test_a_hundred_thousand_lines_over_a_bad_wire_run_line_for_line() -> None:
    lines = program(100_000)
    printer = machine("flip-up:p=0.001", "drop-up:p=0.001")
    result = stream_file(lines, EmbeddedPort(printer), limits=Limits(quiet=0.005))
    assert result.reason == ""
    assert result.sent == result.executed == len(lines)
    assert executed(printer) == lines
    assert result.resends > 100


def test_a_file_is_printed_without_its_comments_and_progress_is_told(tmp_path: Path) -> None:
    file = tmp_path / "part.gcode"
    file.write_text("; made by hand\nG28 ; home\n\nG1 X5 F600\n;LAYER_CHANGE\nG1 X6\n")
    printer = machine()
    told: list[Progress] = []
    result = stream_file(file, EmbeddedPort(printer), on_progress=told.append)
    assert executed(printer) == ["G28", "G1 X5 F600", "G1 X6"]
    assert (told[-1].executed, told[-1].total) == (3, 3)
    assert "T" in told[-1].heaters
    assert result.executed == 3


def test_a_stop_request_ends_feeding_and_switches_the_heaters_off() -> None:
    printer = machine()
    stop = threading.Event()

    def told(progress: Progress) -> None:
        if progress.executed > 10:
            stop.set()

    lines = ["M104 S200", *program(40_000)]
    result = stream_file(lines, EmbeddedPort(printer), on_progress=told, stop=stop)
    assert result.reason == "stopped on request"
    assert result.executed < len(lines)
    assert all(heater.target == 0 for heater in printer.heaters)
    assert [line for line in printer.executed if line.startswith("M104")][-1] == "M104 S0"


def test_a_port_that_goes_away_is_the_reason() -> None:
    result = stream_file(program(500), EmbeddedPort(machine("unplug:line=100")))
    assert "gone" in result.reason
    assert 90 <= result.executed <= 100


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(StreamError, match=r"nothing.gcode: cannot be read: No such file"):
        stream_file(tmp_path / "nothing.gcode", EmbeddedPort(machine()))


def serve(read: "int | socket.socket", printer: SoftwareMachine, over: threading.Event) -> None:
    """Carry bytes between a machine and a file descriptor, until told to stop."""
    number = read if isinstance(read, int) else read.fileno()
    import select

    while not over.is_set():
        ready, _, _ = select.select([number], [], [], 0.005)
        try:
            if ready:
                printer.receive(os.read(number, 4096))
            said = printer.advance(0.001)
            if said:
                os.write(number, said)
        except OSError:
            return


def test_a_pty_prints() -> None:
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    printer = machine("flip-up:line=50", "drop-down:line=80")
    over = threading.Event()
    thread = threading.Thread(target=serve, args=(ours, printer, over))
    thread.start()
    port = open_port(os.ttyname(theirs), 115200)
    try:
        result = stream_file(program(300), port)
    finally:
        over.set()
        thread.join()
        port.close()
        os.close(ours)
        os.close(theirs)
    assert result.reason == ""
    assert executed(printer) == program(300)


def test_a_socket_prints() -> None:
    listener = socket.create_server(("127.0.0.1", 0))
    printer = machine()
    over = threading.Event()
    port = open_port(f"tcp://127.0.0.1:{listener.getsockname()[1]}")
    peer, _ = listener.accept()
    thread = threading.Thread(target=serve, args=(peer, printer, over))
    thread.start()
    try:
        result = stream_file(program(300), port)
    finally:
        over.set()
        thread.join()
        port.close()
        peer.close()
        listener.close()
    assert result.reason == ""
    assert executed(printer) == program(300)


def test_a_firmware_that_never_answers_is_said() -> None:
    listener = socket.create_server(("127.0.0.1", 0))
    port = open_port(f"tcp://127.0.0.1:{listener.getsockname()[1]}")
    try:
        with pytest.raises(StreamError, match="nothing that speaks G-code answered within"):
            stream_file(["G28"], port, limits=Limits(greeting=0.1))
    finally:
        port.close()
        listener.close()


def test_ports_that_cannot_be_opened_are_said(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        free = listener.getsockname()[1]
    cases = {
        str(tmp_path / "ttyNONE"): "there is no such port",
        f"tcp://127.0.0.1:{free}": "nothing listens there",
        "tcp://nowhere": "should be tcp://HOST:PORT",
        "": "the port is empty",
    }
    for url, words in cases.items():
        with pytest.raises(StreamError, match=words):
            open_port(url)


def test_a_port_in_use_is_said() -> None:
    ours, theirs = os.openpty()
    port = open_port(os.ttyname(theirs), 115200)
    try:
        with pytest.raises(StreamError, match="in use by another program"):
            open_port(os.ttyname(theirs), 115200)
    finally:
        port.close()
        os.close(ours)
        os.close(theirs)
