"""The command line: a table of commands, each in its own file, imported only when it is called."""

import importlib
import os
import signal
import sys
from collections.abc import Sequence
from typing import Any

import click

COMMANDS = {
    "demo": "Run the main job on a sample part: slice, dry run, print on the embedded machine, report.",
    "slice": "Turn a mesh into a program for one machine.",
    "place": "Find a placement at which a machine can print a mesh.",
    "check": "Dry-run a program in the software machine and judge it.",
    "print": "Stream a program to a printer.",
    "sim": "Be a printer that any host can connect to.",
    "inverse": "Joint values for tool poses.",
    "forward": "Tool poses for joint values.",
    "machines": "List the machines, or describe one.",
    "settings": "List the print settings with defaults and bounds.",
}


class LazyGroup(click.Group):
    """Knows the names and one-line helps of its commands; imports a command when it is run."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """The command, imported now; None where there is no such name."""
        if name not in COMMANDS:
            return None
        command = importlib.import_module(f"trunnion.commands.{name}_command").command
        if not isinstance(command, click.Command):
            raise TypeError(f"trunnion.commands.{name}_command.command is no command")
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the table without importing anything."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.command(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="trunnion", message="%(version)s")
def trunnion() -> None:
    """Slice, prove and print on 5-axis filament printers."""


def main(words: Sequence[str] | None = None) -> None:
    """Run the command line and leave the process: status 0 good, 1 a bad outcome, 2 misuse or bad input."""
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        status: Any = trunnion.main(args=words, standalone_mode=False)
    except click.UsageError as error:
        error.show()
        status = 2
    except click.exceptions.Exit as leaving:
        status = leaving.exit_code
    except (click.Abort, KeyboardInterrupt):
        print("stopped", file=sys.stderr)
        status = 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 1
    except Exception as error:
        status = _explain(error)
    sys.exit(status if isinstance(status, int) else 0)


def _explain(error: Exception) -> int:
    """Print a user's error as its sentences; let a mistake of ours be seen whole."""
    from trunnion_core.errors import TrunnionError

    if not isinstance(error, TrunnionError | OSError):
        raise error
    for line in str(error).splitlines():
        print(f"error: {line}", file=sys.stderr)
    return 2


def _interrupt(_signal: int, _frame: object) -> None:
    raise KeyboardInterrupt
