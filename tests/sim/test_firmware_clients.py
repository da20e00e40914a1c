"""Hosts that nobody here wrote print through the pseudo terminal exactly, on a clean wire and on a bad one.

printcore (Printrun) and OctoPrint are installed once, each in its own environment beside the one that runs the tests:
their dependencies do not go together with ours. Where they cannot be installed (no package index), the tests skip.
"""

import fcntl
import json
import math
import os
import socket
import subprocess
import sys
import threading
import time
import urllib.request
import venv
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.client import HTTPException
from pathlib import Path
from typing import Any

import pytest

from trunnion_core.profile import load_profile
from trunnion_sim.firmware.faults import parse_fault
from trunnion_sim.firmware.machine import SoftwareMachine
from trunnion_sim.firmware.serve import serve_pty

CLIENTS = {
    "printcore": (("--no-deps", "Printrun==2.2.0"), ("pyserial>=3.5",)),
    "octoprint": (("OctoPrint==1.11.8",),),
}
BAD_WIRE = ["flip-up:bytes=3000", "drop-up:bytes=6000"]
pytestmark = pytest.mark.timeout(900)

PRINTCORE = """
import sys, time
from printrun import gcoder
from printrun.printcore import printcore

core = printcore()
core.connect(sys.argv[1], 250000)
end = time.monotonic() + 60
while not core.online and time.monotonic() < end:
    time.sleep(0.05)
with open(sys.argv[2]) as file:
    core.startprint(gcoder.LightGCode([line.rstrip() for line in file]))
while core.printing and time.monotonic() < end:
    time.sleep(0.05)
time.sleep(0.5)
finished = not core.printing
core.disconnect()
sys.exit(0 if finished else 1)
"""


def client(name: str) -> Path:
    """The environment that holds the client, made where it is missing."""
    home = Path(sys.prefix) / "clients" / name
    home.parent.mkdir(exist_ok=True)
    python = home / "bin" / "python"
    with (home.parent / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        stamp = home / "installed"
        wanted = repr(CLIENTS[name])
        if not stamp.exists() or stamp.read_text() != wanted:
            venv.create(home, with_pip=True, clear=True)
            for words in CLIENTS[name]:
                command = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *words]
                done = subprocess.run(command, capture_output=True, text=True, check=False)
                if done.returncode:
                    pytest.skip(f"{name} cannot be installed here: {done.stderr.strip().splitlines()[-1:]}")
            stamp.write_text(wanted)
    return python


def program(count: int) -> list[str]:
    moves = (
        f"G1 X{40 * math.cos(n / 90):.4f} Y{40 * math.sin(n / 90):.4f} A{10 * math.cos(n / 300):.4f} "
        f"B{5 * math.sin(n / 700):.4f} F3000"
        for n in range(count)
    )
    return ["G28", *moves]


@contextmanager
def machine_at(link: Path, faults: list[str]) -> Iterator[SoftwareMachine]:
    machine = SoftwareMachine(
        load_profile("generic_ab_cradle"), speed=None, faults=[parse_fault(spec) for spec in faults], seed=1
    )
    stop, up = threading.Event(), threading.Event()
    thread = threading.Thread(
        target=serve_pty, args=(machine, link, stop), kwargs={"ready": lambda name: up.set()}, daemon=True
    )
    thread.start()
    assert up.wait(20.0)
    try:
        yield machine
    finally:
        stop.set()
        thread.join()


def ours(machine: SoftwareMachine) -> list[str]:
    """What was executed of the program, leaving out what hosts ask for themselves."""
    return [line for line in machine.executed if line.startswith(("G1", "G28"))]


@pytest.mark.parametrize("faults", [[], BAD_WIRE], ids=["clean", "bad"])
def test_printcore_prints_exactly(tmp_path: Path, faults: list[str]) -> None:
    python = client("printcore")
    lines = program(1500)
    file = tmp_path / "part.gcode"
    file.write_text("\n".join(lines) + "\n")
    with machine_at(tmp_path / "printer", faults) as machine:
        done = subprocess.run(
            [str(python), "-c", PRINTCORE, str(tmp_path / "printer"), str(file)],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
    assert done.returncode == 0, done.stderr[-2000:]
    assert ours(machine) == lines
    assert ("mismatch" in done.stderr) == bool(faults)


KEY = "0123456789ABCDEF0123456789ABCDEF"
CONFIG = """
api: {{key: {key}}}
server:
  firstRun: false
  onlineCheck: {{enabled: false}}
  pluginBlacklist: {{enabled: false}}
accessControl: {{salt: salt}}
serial: {{port: "{port}", baudrate: 250000, autoconnect: true, additionalPorts: ["{port}"]}}
plugins:
  _disabled:
    [softwareupdate, announcements, tracking, discovery, firmware_check, pi_support, errortracking, backup]
"""


def ask(port: int, path: str, data: bytes | None = None, kind: str = "application/json") -> Any:
    request = urllib.request.Request(
        f"http://127.0.0.1:{port}/api/{path}", data=data, headers={"X-Api-Key": KEY, "Content-Type": kind}
    )
    with urllib.request.urlopen(request, timeout=20) as answer:
        return json.loads(answer.read())


def wait_for(what: str, seconds: float, ready: Callable[[], bool]) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            if ready():
                return
        except (OSError, HTTPException):
            pass
        time.sleep(0.3)
    raise AssertionError(f"OctoPrint: {what} took more than {seconds} s")


@contextmanager
def octoprint(python: Path, home: Path, printer: Path) -> Iterator[int]:
    home.mkdir()
    (home / "config.yaml").write_text(CONFIG.format(key=KEY, port=printer))
    command = [str(python.parent / "octoprint"), "--basedir", str(home)]
    environment = {**os.environ, "HOME": str(home)}
    user = ["user", "add", "--admin", "--password", "secret", "tester"]
    subprocess.run([*command, *user], capture_output=True, check=True, env=environment)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    serve = ["serve", "--iknowwhatimdoing", "--host", "127.0.0.1", "--port", str(port)]
    with (home / "out").open("w") as out:
        server = subprocess.Popen([*command, *serve], stdout=out, stderr=out, env=environment)
        try:
            wait_for("starting", 120, lambda: bool(ask(port, "version")))
            yield port
        finally:
            server.terminate()
            server.wait(30)


def print_through_octoprint(port: int, lines: list[str]) -> None:
    wait_for("connecting", 60, lambda: ask(port, "connection")["current"]["state"] == "Operational")
    edge = "edge-of-a-part"
    head = 'Content-Disposition: form-data; name="'
    body = f'--{edge}\r\n{head}file"; filename="part.gcode"\r\nContent-Type: text/plain\r\n\r\n'
    body += "\n".join(lines) + f'\n\r\n--{edge}\r\n{head}print"\r\n\r\ntrue\r\n--{edge}--\r\n'
    ask(port, "files/local", body.encode(), f"multipart/form-data; boundary={edge}")
    done = {"state": "Operational", "progress": 100.0}

    def finished() -> bool:
        job = ask(port, "job")
        return {"state": job["state"], "progress": job["progress"]["completion"]} == done

    wait_for("printing", 120, finished)


@pytest.mark.parametrize("faults", [[], BAD_WIRE], ids=["clean", "bad"])
def test_octoprint_prints_exactly(tmp_path: Path, faults: list[str]) -> None:
    python = client("octoprint")
    lines = program(800)
    printer = tmp_path / "printer"
    with machine_at(printer, faults) as machine, octoprint(python, tmp_path / "home", printer) as port:
        print_through_octoprint(port, lines)
    assert ours(machine) == lines
