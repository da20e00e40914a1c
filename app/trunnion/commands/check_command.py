"""`trunnion check`: the dry run."""

import json
from pathlib import Path

import click

from trunnion.commands.options import EXISTING_FILE, OUTPUT_FILE, machine_option


@click.command("check")
@click.argument("program", type=EXISTING_FILE)
@machine_option()
@click.option("--model", type=EXISTING_FILE, help="The mesh; compares what the beads leave behind with it.")
@click.option("--json", "json_file", type=OUTPUT_FILE, help="Write the report as JSON.")
@click.option("--junit", "junit_file", type=OUTPUT_FILE, help="Write JUnit XML: a test case a finding code.")
@click.option("--html", "html_file", type=OUTPUT_FILE, help="Write one self-contained page: 3D, time slider, findings.")
def command(
    program: Path,
    machine: str,
    model: Path | None,
    json_file: Path | None,
    junit_file: Path | None,
    html_file: Path | None,
) -> None:
    """Run PROGRAM in the software machine and judge it. Exit status: 0 pass, 1 findings, 2 misuse."""
    from trunnion.commands.report import print_findings
    from trunnion.dry_run import check_program
    from trunnion.progress import Progress
    from trunnion_core.output import whole_file
    from trunnion_core.profile import load_profile

    profile = load_profile(machine)
    with Progress(f"checking {program.name}") as progress:
        progress.update()
        report = check_program(program, profile, model)
    data = report.to_json()
    if json_file is not None:
        with whole_file(json_file) as path:
            path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    if junit_file is not None:
        from trunnion.junit import junit_xml

        with whole_file(junit_file) as path:
            path.write_text(junit_xml(report, program.name, profile.name), encoding="utf-8")
    if html_file is not None:
        from trunnion.html_report import report_page

        with whole_file(html_file) as path:
            path.write_text(report_page(report, profile, program.name), encoding="utf-8")
    print_findings(report.findings)
    surface = data.get("surface")
    if surface is not None:
        click.echo(
            f"surface: Chamfer {surface['chamfer_mm']:.4f} mm, RMS {surface['rms_mm']:.4f}, "
            f"95 % under {surface['p95_mm']:.4f}, worst {surface['max_mm']:.4f}"
        )
    click.echo(f"{program}: {report.verdict}, {data['time_s'] / 60:.1f} min, {data['filament_mm']:.0f} mm of filament")
    raise SystemExit(0 if report.verdict == "pass" else 1)
