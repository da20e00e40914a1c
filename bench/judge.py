"""What the judge needs: seconds per printed hour, segments per second, ratio to the printed time, peak memory.

    python bench/judge.py [--segments N] [--bad]

The programs: wavy five-axis layers of `--segments` segments (200,000 are about an hour) on the A-B cradle, the same
number in planar layers on the 3-axis machine; with `--bad` also 5 million lines, a line of 2 GB, and a file of NULs.
Each is judged by `trunnion check` in a process of its own, start-up included; times are user + system.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from trunnion_core.bead import bead_area
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_kinematics.branches import choose
from trunnion_kinematics.chain import JointChain

WIDTH, HEIGHT, PITCH, SEGMENT, SIZE = 0.4, 0.3, 0.36, 0.72, 60.0
"""mm."""
SPEED = 40.0
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
        write(path, layers(cradle, chosen.segments, wave=1.5))
        row("five axes", path, "generic_ab_cradle", chosen.segments)
        write(path, layers(plain, chosen.segments, wave=0.0))
        row("three axes", path, "generic_3axis", chosen.segments)
        if not chosen.bad:
            return
        write(path, layers(plain, 5_000_000, wave=0.0))
        row("5 M lines", path, "generic_3axis", 5_000_000)
        with path.open("wb") as file:
            for _ in range(2048):
                file.write(b"X1" * (1 << 19))
        row("2 GB line", path, "generic_3axis", 0)
        path.write_bytes(bytes(100 << 20))
        row("100 MB of NUL", path, "generic_3axis", 0)


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


def layers(profile: MachineProfile, segments: int, wave: float) -> Iterator[str]:
    """A program of crossed zigzags, wavy by `wave` mm with the tool on the normal, until there are enough segments."""
    chain = JointChain.from_profile(profile)
    per_mm = float(bead_area(np.array(WIDTH), np.array(HEIGHT))) / profile.filament_area
    yield from (f"; machine = {Path(profile.file).stem}", "G21", "G90", "M83", "G28", "M104 S210", "M109 S210")
    layer = 0
    while segments > 0:
        points, axes = _zigzag(layer, wave)
        points, axes = points[: segments + 1], axes[: segments + 1]
        path = choose(chain, profile, points, axes, travel=np.zeros(len(points), dtype=np.bool_))
        joints = path.joints * profile.to_shown
        plastic = np.linalg.norm(np.diff(points, axis=0), axis=1) * per_mm
        yield from (";LAYER_CHANGE", f";WIDTH:{WIDTH}", f";HEIGHT:{HEIGHT}", f";SPEED:{SPEED}", ";ROLE:travel")
        yield from ("G1 E-0.8 F1800", f"G0 Z{points[:, 2].max() + 6 + wave * 6:.3f} F1200")
        words = [" ".join(f"{a}{v:.4f}" for a, v in zip(profile.letters, q, strict=True)) for q in joints.tolist()]
        z = profile.letters.index("Z")
        start = words[0].split()
        yield " ".join(["G0", *(w for k, w in enumerate(start) if k != z), "F6000"])
        yield from (f"G0 {start[z]} F1200", ";ROLE:prime", "G1 E0.8 F1800", ";ROLE:solid_infill")
        yield from (f"G1 {w} E{e:.5f} F{SPEED * 60:.0f}" for w, e in zip(words[1:], plastic.tolist(), strict=True))
        segments -= len(plastic)
        layer += 1
    yield from (";ROLE:retract", "G1 E-0.8 F1800", ";ROLE:travel", "G0 Z200 F1200", "M104 S0", "M84")


def _zigzag(layer: int, wave: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) mm and tool axes (n, 3) of one layer, in `part`."""
    along = np.arange(-SIZE / 2, SIZE / 2, SEGMENT)
    across = np.arange(-SIZE / 2, SIZE / 2, PITCH)
    u = np.where(np.arange(len(across))[:, None] % 2, along[::-1], along)
    v = np.broadcast_to(across[:, None], u.shape)
    x, y = (u, v) if layer % 2 == 0 else (v, u)
    z = (layer + 1) * HEIGHT + wave * (1 + np.cos(x / 9) * np.cos(y / 9))
    slope_x, slope_y = (-wave / 9 * f for f in (np.sin(x / 9) * np.cos(y / 9), np.cos(x / 9) * np.sin(y / 9)))
    normal = np.stack([-slope_x, -slope_y, np.ones_like(z)], axis=-1).reshape(-1, 3)
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), normal / np.linalg.norm(normal, axis=1, keepdims=True)


if __name__ == "__main__":
    main()
