"""`trunnion machines`: what ships, or one machine in full."""

import click


@click.command("machines")
@click.argument("machine", required=False)
@click.option("--schema", is_flag=True, help="Print the JSON schema of profiles instead.")
def command(machine: str | None, schema: bool) -> None:
    """List the machines that ship with Trunnion, or describe MACHINE (a name or a profile's path)."""
    from trunnion_core.profile import load_profile, shipped_profiles

    if schema:
        import json

        from trunnion.reference import profile_schema

        click.echo(json.dumps(profile_schema(), indent=2, sort_keys=True))
        return
    if machine is None:
        for name in shipped_profiles():
            profile = load_profile(name)
            click.echo(f"{name:20} {''.join(profile.letters):6} {profile.firmware:16} {profile.name}")
        return
    profile = load_profile(machine)
    click.echo(f"{profile.name}, {profile.firmware}, from {profile.file}")
    for joint in profile.joints:
        unit = "deg" if joint.rotary else "mm"
        click.echo(
            f"  {joint.letter} {joint.side} {'rotary' if joint.rotary else 'linear'} "
            f"{joint.shown(joint.min):g} to {joint.shown(joint.max):g} {unit}, "
            f"{joint.shown(joint.speed):g} {unit}/s, {joint.shown(joint.acceleration):g} {unit}/s²"
        )
    if profile.assumed:
        click.echo("  assumed, not measured: " + ", ".join(profile.assumed))
