"""`trunnion place`: where on the bed a machine can print a part, before anything is sliced."""

from pathlib import Path

import click

from trunnion.commands.options import EXISTING_FILE, machine_option, settings_options


@click.command("place")
@click.argument("model", type=EXISTING_FILE)
@machine_option()
@settings_options
def command(model: Path, machine: str, settings_file: Path | None, words: tuple[str, ...]) -> None:
    """Find the least turn and shift at which MACHINE reaches every place of MODEL with the tilts it asks for.

    Prints the settings to slice with. Exit status: 0 found, 1 no place does (it says which joint gives up where),
    2 misuse.
    """
    from trunnion.placing import find_placement
    from trunnion_core.errors import PlacementError
    from trunnion_core.profile import load_profile
    from trunnion_core.settings_file import load_settings

    profile = load_profile(machine)
    settings = load_settings(settings_file, words)
    try:
        rotate, shift = find_placement(model, profile, settings)
    except PlacementError as error:
        click.echo(f"error: {error}", err=True)
        raise SystemExit(1) from None
    click.echo(f"--set rotate={rotate:g} --set 'shift=[{shift[0]:g}, {shift[1]:g}]'")
