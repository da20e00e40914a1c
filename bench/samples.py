"""Whole-process CPU time and peak memory of slicing the five samples, beside PrusaSlicer's planar slicing of them.

    python bench/samples.py [--runs N]

PrusaSlicer is the Debian package prusa-slicer; without it only our own figures are printed. Same meshes, layer 0.3,
width 0.4, 2 walls, 3 solid layers, 20 % rectilinear infill. Ours does more: non-planar layers, five-axis motion. Times
are user + system of the finished process as the operating system counts them, start-up included; the runs take turns.
"""

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from trunnion import samples
from trunnion_slicer.mesh_io import write_stl

WIDTHS = ("", "first-layer-", "perimeter-", "external-perimeter-", "infill-", "solid-infill-", "top-infill-")
OPTIONS = """
--loglevel 0 --export-gcode --center 200,200 --bed-shape 0x0,400x0,400x400,0x400 --max-print-height 400
--nozzle-diameter 0.4 --filament-diameter 1.75 --layer-height 0.3 --first-layer-height 0.3 --perimeters 2
--fill-density 20% --fill-pattern rectilinear --top-fill-pattern rectilinear --bottom-fill-pattern rectilinear
--top-solid-layers 3 --bottom-solid-layers 3 --skirts 1 --brim-width 0 --gcode-flavor marlin2
--use-relative-e-distances
"""
WIDTH_OPTIONS = [word for kind in WIDTHS for word in (f"--{kind}extrusion-width", "0.4")]
PRUSA = ["prusa-slicer", *OPTIONS.split(), "--before-layer-gcode", "G92 E0", *WIDTH_OPTIONS]


def main() -> None:
    """Print one row a sample: CPU seconds and peak MiB of both, and their ratios."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--runs", type=int, default=3)
    runs = options.parse_args().runs
    prusa = shutil.which("prusa-slicer") is not None
    print(
        f"{'sample':12}{'ours s':>9}{'MiB':>7}{'planar s':>9}{'MiB':>7}"
        f"{'prusa s':>9}{'MiB':>7}{'ours/p':>9}{'planar/p':>9}"
    )
    with tempfile.TemporaryDirectory() as folder:
        for name in samples.names():
            model = Path(folder) / f"{name}.stl"
            write_stl(samples.make(name), model)
            rows = {"ours": ours(model, name), "planar": [*ours(model, name), "--set", "nonplanar_max_angle=0"]}
            if prusa:
                rows["prusa"] = [*PRUSA, "-o", str(model.with_suffix(".p.gcode")), str(model)]
            for command in rows.values():
                measure(command)
            results: dict[str, list[tuple[float, float]]] = {key: [] for key in rows}
            for _ in range(runs):
                for key, command in rows.items():
                    results[key].append(measure(command))
            medians = {
                key: [statistics.median(column) for column in zip(*r, strict=True)] for key, r in results.items()
            }
            text = f"{name:12}" + "".join(f"{cpu:9.2f}{mib:7.0f}" for cpu, mib in medians.values())
            if prusa:
                base = medians["prusa"][0]
                text += f"{medians['ours'][0] / base:9.2f}{medians['planar'][0] / base:9.2f}"
            print(text, flush=True)


def ours(model: Path, name: str) -> list[str]:
    words = {**samples.settings(name), "perimeters": 2, "fill_density": 20}
    sets = [word for key, value in words.items() for word in ("--set", f"{key}={toml(value)}")]
    out = str(model.with_suffix(".gcode"))
    return [sys.executable, "-m", "trunnion", "slice", str(model), "-m", "generic_ab_cradle", "-o", out, *sets]


def toml(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def measure(command: list[str]) -> tuple[float, float]:
    """CPU seconds and peak MiB of one finished process."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    assert process.stderr is not None
    complaint = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(command)}: {complaint.decode()}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


if __name__ == "__main__":
    main()
