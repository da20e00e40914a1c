"""A software machine behind a pseudo terminal or a TCP port, for hosts that are other programs."""

import contextlib
import math
import os
import select
import socket
import threading
import tty
from collections.abc import Callable
from pathlib import Path

from trunnion_core.errors import StreamError
from trunnion_sim.firmware.embedded import EmbeddedPort, Pace
from trunnion_sim.firmware.machine import SoftwareMachine

__all__ = ["EmbeddedPort", "serve_pty", "serve_tcp"]

CHUNK = 4096
MOST_UNREAD = 1 << 16
"""Bytes kept for a host that does not read; older ones are lost, as on a wire."""


def serve_pty(
    machine: SoftwareMachine,
    link: Path | None,
    stop: threading.Event,
    *,
    ready: Callable[[str], None] | None = None,
) -> None:
    """Serve on a new pseudo terminal until `stop` is set; `link` becomes a symbolic link to it.

    A machine that was unplugged and comes back gets another terminal. `ready` is called with the name of each.
    Raises StreamError where the link cannot be made.
    """
    while True:
        _one_terminal(machine, link, stop, ready)
        if not _plugged_in_again(machine, stop):
            return


def serve_tcp(
    machine: SoftwareMachine,
    host: str,
    port: int,
    stop: threading.Event,
    *,
    ready: Callable[[str], None] | None = None,
) -> None:
    """Serve one connection after the other on host:port until `stop` is set; the machine lives on between them.

    An empty `host` is this computer only. `ready` is called with HOST:PORT. Raises StreamError where the port is taken.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as door:
        door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            door.bind((host or "127.0.0.1", port))
        except OSError as error:
            raise StreamError(f"{host}:{port}: cannot listen there: {error.strerror or error}") from None
        door.listen(1)
        if ready is not None:
            ready("{}:{}".format(*door.getsockname()))
        while not stop.is_set():
            if not select.select([door], [], [], 0.1)[0]:
                continue
            connection, _ = door.accept()
            with connection:
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                connection.setblocking(False)
                _serve(machine, connection.fileno(), stop)
            if not machine.connected and not _plugged_in_again(machine, stop):
                return


def _one_terminal(
    machine: SoftwareMachine, link: Path | None, stop: threading.Event, ready: Callable[[str], None] | None
) -> None:
    ours, theirs = os.openpty()
    try:
        tty.setraw(theirs)
        os.set_blocking(ours, False)
        name = os.ttyname(theirs)
        if link is not None:
            _make_link(link, name)
        if ready is not None:
            ready(name)
        try:
            _serve(machine, ours, stop)
        finally:
            if link is not None and link.is_symlink() and str(link.readlink()) == name:
                link.unlink()
    finally:
        os.close(ours)
        os.close(theirs)


def _plugged_in_again(machine: SoftwareMachine, stop: threading.Event) -> bool:
    """Wait while the cable is out; False where the end has come or it never goes in again."""
    pace = Pace(machine)
    while not stop.is_set() and not machine.connected and math.isfinite(machine.unplugged_until):
        stop.wait(pace.sleep())
        machine.advance(pace.elapsed())
    return machine.connected and not stop.is_set()


def _serve(machine: SoftwareMachine, wire: int, stop: threading.Event) -> None:
    """Pump bytes and time until `stop`, or the other side hangs up, or the machine is unplugged."""
    pace = Pace(machine)
    unread = bytearray()
    while not stop.is_set() and machine.connected:
        readable, _, _ = select.select([wire], [wire] if unread else [], [], pace.sleep())
        unread += machine.advance(pace.elapsed())
        if readable:
            try:
                data = os.read(wire, CHUNK)
            except BlockingIOError:
                data = None
            except OSError:
                return
            if data == b"":
                return
            if data:
                machine.receive(data)
                pace.active()
                unread += machine.advance(0.0)
        if unread:
            with contextlib.suppress(BlockingIOError):
                try:
                    del unread[: os.write(wire, unread)]
                except (BrokenPipeError, ConnectionResetError):
                    return
            del unread[: max(len(unread) - MOST_UNREAD, 0)]


def _make_link(link: Path, name: str) -> None:
    if link.is_symlink():
        link.unlink()
    try:
        link.symlink_to(name)
    except OSError as error:
        raise StreamError(f"{link}: cannot become a link to {name}: {error.strerror}") from None
