"""A command and its number become the bytes of a line."""

from functools import reduce
from operator import xor


def numbered(number: int, command: str) -> bytes:
    """`N<number> <command>*<checksum>` and a newline; the checksum is the exclusive or of all bytes before the `*`."""
    body = f"N{number} {command}".encode("ascii")
    return b"%b*%d\n" % (body, reduce(xor, body))
