"""`trunnion sim`: a firmware that any host can connect to."""

from pathlib import Path

import click

from trunnion.commands.options import machine_option


@click.command("sim")
@machine_option()
@click.option("--pty", type=click.Path(path_type=Path), help="Make this path a link to a pseudo terminal.")
@click.option("--tcp", metavar="HOST:PORT", help="Listen there; HOST should be 127.0.0.1 or localhost.")
@click.option("--speed", default="1", metavar="FACTOR|max", help="How much faster than real time; max: no waiting.")
@click.option("--fault", "faults", multiple=True, metavar="SPEC", help="Misbehave so; may be given several times.")
@click.option("--seed", default=0, help="Seed of everything random, for a replay.")
def command(machine: str, pty: Path | None, tcp: str | None, speed: str, faults: tuple[str, ...], seed: int) -> None:
    """Be a printer. Runs until it is told to stop (Ctrl-C)."""
    import threading

    from trunnion_core.profile import load_profile
    from trunnion_sim.firmware.faults import parse_fault
    from trunnion_sim.firmware.machine import SoftwareMachine
    from trunnion_sim.firmware.serve import serve_pty, serve_tcp

    if (pty is None) == (tcp is None):
        raise click.UsageError("give either --pty PATH or --tcp HOST:PORT")
    factor = _factor(speed)
    software = SoftwareMachine(
        load_profile(machine), speed=factor, faults=[parse_fault(spec) for spec in faults], seed=seed
    )
    stop = threading.Event()
    try:
        if pty is not None:
            serve_pty(software, pty, stop, ready=_say_where)
        elif tcp is not None:
            host, _, port = tcp.rpartition(":")
            if not host or not port.isdigit() or not 0 <= int(port) < 65536:
                raise click.BadParameter(f"'{tcp}' should be HOST:PORT, as in 127.0.0.1:4000", param_hint="--tcp")
            serve_tcp(software, host, int(port), stop, ready=_say_where)
    finally:
        stop.set()


def _factor(text: str) -> float | None:
    if text == "max":
        return None
    try:
        factor = float(text)
    except ValueError:
        factor = 0.0
    if not 0.1 <= factor <= 1e6:
        raise click.BadParameter(f"'{text}' should be a factor of at least 0.1, or max", param_hint="--speed")
    return factor


def _say_where(place: str) -> None:
    click.echo(f"listening on {place}", err=True)
