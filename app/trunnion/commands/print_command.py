"""`trunnion print`: stream a program from the terminal."""

from pathlib import Path

import click

from trunnion.commands.options import EXISTING_FILE, machine_option


@click.command("print")
@click.argument("program", type=EXISTING_FILE)
@machine_option()
@click.option("--port", required=True, metavar="PORT", help="A device, a pty, tcp://HOST:PORT, or sim.")
@click.option("--baud", type=int, help="Speed of a serial device; by default the profile's.")
def command(program: Path, machine: str, port: str, baud: int | None) -> None:
    """Stream PROGRAM to a printer. Exit status: 0 every line was executed, 1 the print stopped, 2 misuse.

    Ctrl-C stops feeding, switches the heaters off and leaves.
    """
    import signal
    import threading

    from trunnion.printing import open_printer, print_program
    from trunnion.progress import Progress
    from trunnion_core.errors import StreamError
    from trunnion_core.profile import load_profile

    profile = load_profile(machine)
    stop = threading.Event()
    earlier = signal.signal(signal.SIGINT, lambda _number, _frame: stop.set())
    try:
        with Progress(f"printing {program.name}") as progress, open_printer(port, profile, baud) as printer:
            result = print_program(
                program, printer, profile, progress=progress.update, on_warning=progress.warn, stop=stop
            )
    except StreamError as error:
        click.echo(f"error: {error}", err=True)
        raise SystemExit(1) from None
    finally:
        signal.signal(signal.SIGINT, earlier)
    if result.reason:
        click.echo(f"{program}: stopped after {result.executed} lines: {result.reason}", err=True)
        raise SystemExit(1)
    click.echo(f"{program}: printed, {result.executed} lines executed")
