"""The machine behind a call, a pseudo terminal and TCP: the same machine, for any thread or program."""

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import reduce
from operator import xor
from pathlib import Path

import pytest
import serial

from trunnion_core.errors import StreamError
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_sim.firmware.faults import parse_fault
from trunnion_sim.firmware.machine import SoftwareMachine
from trunnion_sim.firmware.serve import EmbeddedPort, serve_pty, serve_tcp


@pytest.fixture(scope="module")
def profile() -> MachineProfile:
    return load_profile("generic_ab_cradle")


def numbered(n: int, text: str) -> bytes:
    head = f"N{n} {text}".encode()
    return head + b"*%d\n" % reduce(xor, head)


def until_ok(port: EmbeddedPort) -> bytes:
    said = b""
    while b"ok" not in said:
        said += port.read(5.0)
    return said


@contextmanager
def serving(serve: Callable[..., None], *words: object) -> Iterator[str]:
    stop, up = threading.Event(), threading.Event()
    names: list[str] = []

    def ready(name: str) -> None:
        names.append(name)
        up.set()

    thread = threading.Thread(target=serve, args=(*words, stop), kwargs={"ready": ready})
    thread.start()
    assert up.wait(10.0)
    try:
        yield names[0]
    finally:
        stop.set()
        thread.join()


def test_embedded_port_runs_a_program_in_simulated_time(profile: MachineProfile) -> None:
    machine = SoftwareMachine(profile, speed=None)
    port = EmbeddedPort(machine)
    assert port.read(1.0).startswith(b"start\n")
    program = ["G28", *(f"G1 X{n % 50} A{n % 20} F1200" for n in range(500)), "G4 S30", "M400"]
    for n, line in enumerate(program, 1):
        port.write(numbered(n, line))
        until_ok(port)
    assert machine.executed == program
    assert machine.now > 50.0
    trace = machine.trace()
    assert (trace.time[1:] >= trace.time[:-1]).all()
    assert trace.time[-1] <= machine.now


def test_embedded_port_keeps_the_planner_fed_by_four_lines_in_flight(profile: MachineProfile) -> None:
    """Simulated time of a streamed job is that of its motion: no block waits for a host that lives in real time."""
    machine = SoftwareMachine(profile, speed=None)
    port = EmbeddedPort(machine)
    count = 400
    lines = [numbered(n, f"G1 X{0.5 * n:.1f} F3000") for n in range(1, count + 1)]
    sent = acknowledged = 0
    while acknowledged < count:
        while sent < count and sent - acknowledged < 4:
            port.write(lines[sent])
            sent += 1
        acknowledged += port.read(5.0).count(b"ok\n")
    machine.finish()
    assert machine.now == pytest.approx(0.5 * count / 50.0, rel=0.02, abs=0.15)


def test_readers_in_other_threads_wake_up_on_close(profile: MachineProfile) -> None:
    port = EmbeddedPort(SoftwareMachine(profile))
    failed = threading.Event()

    def read() -> None:
        try:
            while True:
                port.read(60.0)
        except OSError:
            failed.set()

    thread = threading.Thread(target=read)
    thread.start()
    port.close()
    thread.join(5.0)
    assert failed.is_set()
    with pytest.raises(OSError, match="closed"):
        port.write(b"M105\n")


def test_an_unplugged_port_is_an_error(profile: MachineProfile) -> None:
    port = EmbeddedPort(SoftwareMachine(profile, speed=None, faults=[parse_fault("unplug:line=2")]))
    port.write(b"M107\n")
    until_ok(port)
    port.write(b"M107\n")
    with pytest.raises(OSError, match="gone"):
        port.read(0.1)


def test_two_threads_lose_no_byte(profile: MachineProfile) -> None:
    machine = SoftwareMachine(profile, speed=None)
    port = EmbeddedPort(machine)
    room = threading.Semaphore(3)

    def write() -> None:
        for n in range(1, 301):
            room.acquire()
            port.write(numbered(n, f"M106 S{n % 255}"))

    thread = threading.Thread(target=write)
    thread.start()
    oks = 0
    while oks < 300:
        for _ in range(port.read(5.0).count(b"ok\n")):
            oks += 1
            room.release()
    thread.join()
    assert len(machine.executed) == 300


def test_pseudo_terminal_is_raw_and_linked(profile: MachineProfile, tmp_path: Path) -> None:
    link = tmp_path / "printer"
    machine = SoftwareMachine(profile, speed=None)
    with serving(serve_pty, machine, link) as name:
        assert str(link.readlink()) == name
        with serial.Serial(str(link), 250000, timeout=10) as port:
            port.write(b"M118 \xb0 caf\xe9\r\nG4 S20\n")
            heard = port.read_until(b"Sleep...\n") + port.read_until(b"ok\n")
    assert b"\xb0 caf\xe9\nok\n" in heard
    assert not link.is_symlink()


def test_a_link_is_not_made_over_a_file(profile: MachineProfile, tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("keep me")
    with pytest.raises(StreamError, match="precious"):
        serve_pty(SoftwareMachine(profile), precious, threading.Event())
    assert precious.read_text() == "keep me"


def test_tcp_serves_one_host_after_the_other_and_only_this_computer(profile: MachineProfile) -> None:
    machine = SoftwareMachine(profile, speed=None)
    with serving(serve_tcp, machine, "", 0) as address:
        host, number = address.split(":")
        assert host == "127.0.0.1"
        for turn in range(2):
            with socket.create_connection((host, int(number)), timeout=10) as wire, wire.makefile("rb") as lines:
                if turn == 0:
                    assert lines.readline() == b"start\n"
                wire.sendall(numbered(turn + 1, "M107"))
                while lines.readline() != b"ok\n":
                    pass
        with pytest.raises(StreamError, match="cannot listen"):
            serve_tcp(machine, host, int(number), threading.Event())
    assert machine.executed == ["M107", "M107"]


def test_speed_must_be_a_factor(profile: MachineProfile) -> None:
    for speed in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="as fast as possible"):
            SoftwareMachine(profile, speed=speed)


def test_a_port_comes_back_under_another_name_and_the_machine_knows_its_numbers(
    profile: MachineProfile, tmp_path: Path
) -> None:
    machine = SoftwareMachine(profile, speed=None, faults=[parse_fault("unplug:line=3,seconds=0.2")])
    link = tmp_path / "printer"
    names: list[str] = []
    stop, again = threading.Event(), threading.Event()

    def ready(name: str) -> None:
        names.append(name)
        again.set()

    thread = threading.Thread(target=serve_pty, args=(machine, link, stop), kwargs={"ready": ready})
    thread.start()
    try:
        assert again.wait(10.0)
        with serial.Serial(str(link), 250000, timeout=10) as port:
            for n in (1, 2):
                port.write(numbered(n, "M107"))
                port.read_until(b"ok\n")
            again.clear()
            port.write(numbered(3, "M107"))
            assert again.wait(10.0)
        with serial.Serial(str(link), 250000, timeout=10) as port:
            port.write(b"M110\n")
            assert port.read_until(b"ok\n").endswith(b"Line: 3\nok\n")
    finally:
        stop.set()
        thread.join()
    assert len(names) == 2
    assert not link.is_symlink()
