"""The emergency parser: commands that act the moment their line ends, whatever waits in the queue.

It watches every byte that arrives, before the ring, and consumes none (Marlin 2.1 `e_parser.h`): M108 ends waits,
M112 kills, M410 stops motion, M876 answers a prompt, S000 asks for a position.
"""

import re

COMMAND = re.compile(rb" *(?:N[-\d ]*)?(?P<code>M108|M112|M410|M876(?: *S *(?P<answer>\d))?|S000)")
INTERESTING = re.compile(rb"M(?:108|112|410|876)|S000")
LONGEST = 96


class EmergencyParser:
    """Keeps the beginning of the unfinished line, and nothing else."""

    def __init__(self) -> None:
        self._line = b""

    def feed(self, data: bytes) -> tuple[str, int | None] | None:
        """Take bytes of which at most the last ends a line; answers with the code and M876's number."""
        if data[-1:] not in (b"\n", b"\r"):
            if len(self._line) < LONGEST:
                self._line = (self._line + data)[:LONGEST]
            return None
        line = self._line + data if self._line else data
        self._line = b""
        if not INTERESTING.search(line):
            return None
        found = COMMAND.match(line[:LONGEST])
        if found is None:
            return None
        code = found["code"][:4].decode("ascii")
        answer = found["answer"]
        return code, None if answer is None else int(answer)
