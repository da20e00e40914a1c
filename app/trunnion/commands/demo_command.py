"""`trunnion demo`: the main job on a sample part."""

from pathlib import Path

import click


@click.command("demo")
@click.option("--part", default="freeform", show_default=True, help="Which sample.")
@click.option("-m", "--machine", default="generic_ab_cradle", show_default=True, help="A machine's name or profile.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("trunnion-demo"),
    show_default=True,
    help="Folder for everything that is made.",
)
def command(part: str, machine: str, output: Path) -> None:
    """Sample mesh, slice, dry run, print on the embedded software machine, report with pictures."""
    from trunnion.demo import run_demo

    report = run_demo(part, machine, output, say=lambda text: click.echo(text, err=True))
    click.echo(f"open {report}")
