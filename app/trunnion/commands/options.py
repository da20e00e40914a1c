"""Options that several commands share."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

EXISTING_FILE = click.Path(path_type=Path)
OUTPUT_FILE = click.Path(path_type=Path, dir_okay=False)


def machine_option(*, required: bool = True) -> Decorator:
    """`-m`: a shipped machine's name or the path of a profile."""
    return click.option(
        "-m", "--machine", required=required, metavar="MACHINE", help="A shipped machine's name, or a profile's path."
    )


def settings_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """`-s FILE` and `--set key=value`."""
    function = click.option(
        "--set", "words", multiple=True, metavar="KEY=VALUE", help="One print setting; wins over the file."
    )(function)
    return click.option("-s", "--settings", "settings_file", type=EXISTING_FILE, help="Print settings, TOML.")(function)
