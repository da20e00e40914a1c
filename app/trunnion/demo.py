"""The main job end to end on one sample part, with pictures, in one folder."""

import html
import json
from collections.abc import Callable
from pathlib import Path

from trunnion_core.errors import SettingsError, StreamError
from trunnion_core.profile import load_profile
from trunnion_core.settings import PrintSettings
from trunnion_core.validation import nearest
from trunnion_slicer.mesh_io import write_stl

from trunnion import samples
from trunnion.dry_run import check_program
from trunnion.output import whole_file
from trunnion.pictures import draw_deviation, draw_joints, draw_toolpath
from trunnion.pipeline import Timings, load_part, make_job, write_job
from trunnion.printing import open_printer, print_program

PICTURES = {
    "toolpath.png": "The toolpath, coloured by role",
    "deviation.png": "What the beads leave behind, against the model",
    "joints.png": "The joints over time, as the software machine moved them",
}


def run_demo(part: str, machine: str, folder: Path, say: Callable[[str], None]) -> Path:
    """Make, slice, dry-run and print the sample in `folder`; returns the page to open.

    Raises SettingsError for an unknown sample, StreamError when the print does not execute every line.
    """
    if part not in samples.names():
        raise SettingsError("--part", [f"{part}: no such sample, {nearest(part, samples.names())}"])
    profile = load_profile(machine)
    settings = PrintSettings.model_validate(samples.settings(part))
    folder.mkdir(parents=True, exist_ok=True)
    timings = Timings()
    model, program = folder / f"{part}.stl", folder / f"{part}.gcode"
    with timings.stage("sample"):
        write_stl(samples.make(part), model)
    say(f"slicing {model}")
    placed = load_part(model, profile, settings, timings)
    job = make_job(placed, profile, settings, timings)
    summary = write_job(job, program, timings)
    say(f"checking {program}: {summary.lines} lines")
    with timings.stage("check"):
        report = check_program(program, profile, model)
    say(f"printing {program} on the embedded machine")
    with timings.stage("print"), open_printer("sim", profile) as printer:
        result = print_program(program, profile, printer)
    if result.reason:
        raise StreamError(f"{program}: stopped after {result.executed} lines: {result.reason}")
    say("drawing")
    with timings.stage("pictures"):
        title = f"{part} on {profile.name}"
        draw_toolpath(job.toolpath, folder / "toolpath.png", title)
        if report.surface is not None:
            draw_deviation(report.surface.points, report.surface.deviation, folder / "deviation.png", title)
        draw_joints(report.trace, profile, folder / "joints.png", title)
    data = report.to_json()
    (folder / "check.json").write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    page = folder / "index.html"
    facts = {
        "machine": profile.name,
        "verdict of the dry run": report.verdict,
        "findings": ", ".join(f"{code}: {count}" for code, count in data["counts"].items()) or "none",
        "lines sent and executed": f"{result.executed}",
        "print time": f"{data['time_s'] / 60:.1f} min",
        "filament": f"{data['filament_mm']:.0f} mm",
        "Chamfer distance": f"{data['surface']['chamfer_mm']:.4f} mm" if data.get("surface") else "not compared",
        "time taken": ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in timings.seconds.items()),
    }
    with whole_file(page) as path:
        path.write_text(_page(part, facts), encoding="utf-8")
    say(f"{report.verdict}: {summary.lines} lines, {data['time_s'] / 60:.1f} min, every line executed")
    return page


def _page(part: str, facts: dict[str, str]) -> str:
    rows = "".join(f"<tr><th>{html.escape(key)}</th><td>{html.escape(value)}</td></tr>" for key, value in facts.items())
    figures = "".join(
        f'<figure><img src="{name}" alt="{text}"><figcaption>{text}</figcaption></figure>'
        for name, text in PICTURES.items()
    )
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>Trunnion: {html.escape(part)}</title>"
        "<style>body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem}"
        "img{max-width:100%}th{text-align:left;padding-right:1rem;vertical-align:top}figure{margin:2rem 0}</style>"
        f"<h1>{html.escape(part)}</h1><table>{rows}</table>{figures}</html>\n"
    )
