"""The main job end to end on one sample part, with pictures, in one folder."""

import json
from collections.abc import Callable
from pathlib import Path

from trunnion import samples
from trunnion.commands.report import print_findings
from trunnion.dry_run import check_program
from trunnion.html_report import report_page
from trunnion.pictures import draw_deviation, draw_joints, draw_toolpath
from trunnion.pipeline import Timings, load_part, make_job, write_job
from trunnion.printing import open_printer, print_program
from trunnion_core.errors import SettingsError, StreamError
from trunnion_core.output import whole_file
from trunnion_core.profile import load_profile
from trunnion_core.settings import PrintSettings
from trunnion_core.validation import nearest
from trunnion_slicer.mesh_io import write_stl


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
        result = print_program(program, printer, profile)
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
    with whole_file(page) as path:
        path.write_text(report_page(report, profile, f"{part} on {profile.name}"), encoding="utf-8")
    print_findings(report.findings)
    stages = ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in timings.seconds.items())
    say(f"took {stages}")
    say(f"{report.verdict}: {result.executed} commands sent and executed, {data['time_s'] / 60:.1f} min on the machine")
    return page
