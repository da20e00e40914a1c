"""What the judge needs: seconds per printed hour, segments per second, ratio to the printed time, peak memory.

    python bench/judge.py [--segments N] [--bad]

The programs: wavy five-axis layers of `--segments` segments (200,000 are about an hour) on the A-B cradle, the same
number in planar layers on the 3-axis machine; with `--bad` also programs of millions of lines, moves, arcs, odd words,
limits and offsets, a line of 2 GB, and a file of NULs, none of which may take 2 GB of memory.
Each is judged by `trunnion check` in a process of its own, start-up included; times are user + system.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from itertools import chain, count, islice
from pathlib import Path

import numpy as np

from trunnion_core.bead import bead_area, bead_spacing
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_gcode.write import write_program
from trunnion_motion.plan import plan_motion

WIDTH, HEIGHT, SEGMENT, SIZE = 0.4, 0.3, 0.72, 60.0
"""mm."""
PITCH = bead_spacing(WIDTH, HEIGHT)
GROWTH, SCALE = 0.1, 9.0
"""mm by which the waves of a layer are higher than those of the one below, and of their length over two pi."""
CLEAR = 6.0
"""mm above a layer, for travels."""
MIDDLE = 110.0
"""mm: where the middle of the 3-axis machine's bed is, in its own words."""
SPEED, TRAVEL = 40.0, 100.0
"""mm/s."""


def main() -> None:
    """Print one row a program."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--segments", type=int, default=200_000)
    options.add_argument("--bad", action="store_true")
    chosen = options.parse_args()
    head = ("exit", "segments", "printed h", "CPU s", "s / h", "seg/s", "ratio", "MiB")
    print(f"{'program':14}" + "".join(f"{word:>{w}}" for word, w in zip(head, (5, 10, 10, 8, 8, 8, 8, 7), strict=True)))
    with tempfile.TemporaryDirectory() as folder:
        cradle, plain = load_profile("generic_ab_cradle"), load_profile("generic_3axis")
        path = Path(folder) / "program.gcode"
        planned(path, cradle, chosen.segments)
        row("five axes", path, "generic_ab_cradle", chosen.segments)
        write(path, layers("generic_3axis", plain.filament_area, chosen.segments))
        row("three axes", path, "generic_3axis", chosen.segments)
        if not chosen.bad:
            return
        for name, lines in bad(plain.filament_area).items():
            write(path, lines)
            row(name, path, "generic_ab_cradle" if name == "5 M tilting" else "generic_3axis", 0)
        with path.open("wb") as file:
            for _ in range(2048):
                file.write(b"X1" * (1 << 19))
        row("2 GB line", path, "generic_3axis", 0)
        path.write_bytes(bytes(100 << 20))
        row("100 MB of NUL", path, "generic_3axis", 0)


def bad(filament_area: float) -> dict[str, Iterator[str]]:
    """Programs that are long or odd, by name."""
    start = ("G21", "G90", "M83", "G28", "M104 S210", "M109 S210")
    tilting = (f"G1 X{k % 97 * 0.5:.1f} Y{k % 89 * 0.5:.1f} Z{60 + k % 7} A{k % 61 - 30} B{k % 53}" for k in count())
    moves = (f"G1 X{k % 97 + 50} Y{k % 89 + 50} E0.01" for k in count())
    return {
        "5 M lines": layers("generic_3axis", filament_area, 5_000_000),
        "5 M tilting": chain(start, ("G1 F3000",), islice(tilting, 5_000_000)),
        "7 M moves": chain(start, ("G1 Z5 F6000",), islice(moves, 7_000_000)),
        "4 k big arcs": chain(start, ("G0 X20 Y110 F6000",), ("G2 X20 Y110 I90 J0" for _ in range(4_000))),
        "2 M odd words": chain(start, (("M1234 S1", "G0 Q7", "G1 X", "?!")[k % 4] for k in range(2_000_000))),
        "500 k limits": chain(
            start, (f"M204 P{500 + k % 500}" if k % 2 else f"G1 X{k % 97} F6000" for k in range(1_000_000))
        ),
        "1 M offsets": chain(start, ("G92 X0" if k % 2 else "G1 X0.01 F6000" for k in range(2_000_000))),
    }


def row(name: str, path: Path, machine: str, segments: int) -> None:
    """Judge one program and print what it took."""
    report = path.with_suffix(".json")
    report.unlink(missing_ok=True)
    command = [sys.executable, "-m", "trunnion", "check", str(path), "-m", machine, "--json", str(report)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    cpu = usage.ru_utime + usage.ru_stime
    text = f"{name:14}{process.returncode:5d}"
    if report.exists() and segments:
        printed = json.loads(report.read_text())["time_s"]
        text += f"{segments:10d}{printed / 3600:10.2f}{cpu:8.1f}{cpu / printed * 3600:8.1f}"
        text += f"{segments / cpu:8.0f}{printed / cpu:7.0f}x"
    else:
        text += f"{'':20}{cpu:8.1f}{'':24}"
    print(f"{text}{usage.ru_maxrss / 1024:7.0f}", flush=True)


def write(path: Path, lines: Iterator[str]) -> None:
    with path.open("w", encoding="ascii") as file:
        file.writelines(f"{line}\n" for line in lines)


def planned(path: Path, profile: MachineProfile, segments: int) -> None:
    """Write a program of crossed zigzags whose layers grow wavy, the tool on the normal, timed for the machine."""
    layers = math.ceil(segments / len(_zigzag(0)))
    parts = []
    for k in range(layers):
        xy = _zigzag(k)
        x, y = xy.T
        wave = np.cos(x / SCALE) * np.cos(y / SCALE)
        slope_x, slope_y = (-k * GROWTH / SCALE * np.sin(a / SCALE) * np.cos(b / SCALE) for a, b in ((x, y), (y, x)))
        normal = np.stack([-slope_x, -slope_y, np.ones(len(x))], axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        points = np.column_stack([xy, (k + 1) * HEIGHT + k * GROWTH * wave])
        height = np.where(k > 0, HEIGHT + GROWTH * wave, HEIGHT) * normal[:, 2]
        above = points[:, 2].max() + CLEAR
        way = np.array([[*xy[0], above], points[0]])
        leave = np.array([[*xy[-1], above]])
        up = np.array([[0.0, 0.0, 1.0]])
        bead = np.repeat([False, True, False], [2, len(xy) - 1, 1])
        parts.append(
            (
                np.concatenate([way, points[1:], leave]),
                np.concatenate([normal[:1], normal, normal[-1:]]) if k else np.repeat(up, len(xy) + 2, axis=0),
                bead,
                np.where(bead, np.concatenate([[0.0], height, [0.0]]), 0.0),
                np.full(len(bead), k),
            )
        )
    points, axes, bead, height, layer = (np.concatenate(column) for column in zip(*parts, strict=True))
    toolpath = Toolpath(
        points=points,
        tool_axes=axes,
        width=np.where(bead, WIDTH, 0.0),
        height=height,
        role=np.where(bead, Role.NONPLANAR_INFILL, Role.TRAVEL),
        layer=layer,
        speed=np.where(bead, SPEED, TRAVEL),
    )
    settings = PrintSettings()
    write_program(plan_motion(toolpath, profile, settings).program, profile, settings, title="waves", out=path)


def layers(machine: str, filament_area: float, segments: int) -> Iterator[str]:
    """A program of crossed zigzags in planar layers, until there are enough segments."""
    per_mm = float(bead_area(np.array(WIDTH), np.array(HEIGHT))) / filament_area
    yield from (f"; machine = {machine}", "G21", "G90", "M83", "G28", "M104 S210", "M109 S210")
    z = 0.0
    for k in count():
        if segments <= 0:
            break
        xy = _zigzag(k)[: segments + 1]
        z += HEIGHT
        plastic = np.linalg.norm(np.diff(xy, axis=0), axis=1) * per_mm
        yield from (";LAYER_CHANGE", f";WIDTH:{WIDTH}", f";HEIGHT:{HEIGHT}", f";SPEED:{SPEED}", ";ROLE:travel")
        yield from ("G1 E-0.8 F1800", f"G0 Z{z + CLEAR:.3f} F600")
        words = [f"X{x + MIDDLE:.4f} Y{y + MIDDLE:.4f}" for x, y in xy.tolist()]
        yield from (f"G0 {words[0]} F6000", f"G0 Z{z:.3f} F600", ";ROLE:prime", "G1 E0.8 F1800", ";ROLE:solid_infill")
        yield from (f"G1 {w} E{e:.5f} F{SPEED * 60:.0f}" for w, e in zip(words[1:], plastic.tolist(), strict=True))
        segments -= len(plastic)
    yield from (";ROLE:retract", "G1 E-0.8 F1800", ";ROLE:travel", f"G0 Z{z + CLEAR:.3f} F600", "M104 S0", "M84")


def _zigzag(layer: int) -> np.ndarray:
    """(n, 2) mm, X and Y in `part`, of one layer; every other layer is turned by a right angle."""
    along = np.arange(-SIZE / 2, SIZE / 2, SEGMENT)
    across = np.arange(-SIZE / 2, SIZE / 2, PITCH)
    u = np.where(np.arange(len(across))[:, None] % 2, along[::-1], along)
    v = np.broadcast_to(across[:, None], u.shape)
    return np.stack([u, v] if layer % 2 == 0 else [v, u], axis=-1).reshape(-1, 2)


if __name__ == "__main__":
    main()
