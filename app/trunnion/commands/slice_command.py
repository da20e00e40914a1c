"""`trunnion slice`: a mesh becomes a program."""

from pathlib import Path

import click

from trunnion.commands.options import EXISTING_FILE, OUTPUT_FILE, machine_option, settings_options


@click.command("slice")
@click.argument("model", type=EXISTING_FILE)
@machine_option()
@settings_options
@click.option("-o", "--output", type=OUTPUT_FILE, help="G-code to write; by default MODEL with .gcode.")
@click.option("--toolpath", type=OUTPUT_FILE, help="Also write the toolpath's arrays (part frame) as .npz.")
@click.option("--timings", is_flag=True, help="Print the seconds of every stage on stderr.")
def command(
    model: Path,
    machine: str,
    settings_file: Path | None,
    words: tuple[str, ...],
    output: Path | None,
    toolpath: Path | None,
    timings: bool,
) -> None:
    """Slice MODEL (STL, OBJ, PLY or 3MF) for one machine."""
    from trunnion.commands.report import print_findings, print_timings
    from trunnion.pipeline import Timings, load_part, make_job, write_job
    from trunnion.progress import Progress
    from trunnion_core.output import whole_file
    from trunnion_core.profile import load_profile
    from trunnion_core.settings_file import load_settings

    profile = load_profile(machine)
    settings = load_settings(settings_file, words)
    stages = Timings()
    with Progress(f"slicing {model.name}") as progress:
        progress.update()
        part = load_part(model, profile, settings, stages)
        job = make_job(part, profile, settings, stages)
        out = output or model.with_suffix(".gcode")
        summary = write_job(job, out, stages)
        if toolpath is not None:
            with whole_file(toolpath) as path:
                job.toolpath.save(path)
    print_findings(job.findings)
    if timings:
        print_timings(stages)
    minutes = summary.time_s / 60
    click.echo(f"{out}: {summary.lines} lines, {minutes:.1f} min, {summary.filament_mm:.0f} mm of filament")
