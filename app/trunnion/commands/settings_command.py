"""`trunnion settings`: every print setting with its default and help."""

import click


@click.command("settings")
def command() -> None:
    """List the print settings with their defaults."""
    from trunnion_core.settings import PrintSettings

    for name, field in PrintSettings.model_fields.items():
        default = "" if field.default is None else f" [{field.default}]"
        click.echo(f"{name}{default}\n    {field.description}")
