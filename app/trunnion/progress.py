"""One line of progress on stderr for what takes longer than a second; silent when stderr is no terminal."""

import sys
import time
from types import TracebackType

PATIENCE = 1.0
"""s before anything is shown: what is quicker needs no progress."""
REFRESH = 0.2
"""s between two updates."""


class Progress:
    """A context that shows `text` and, when told, a fraction."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._started = time.monotonic()
        self._shown = 0.0
        self._wide = 0

    def update(self, fraction: float | None = None, note: str = "") -> None:
        """Show how far it is; called as often as the work likes."""
        now = time.monotonic()
        if not sys.stderr.isatty() or now - self._started < PATIENCE or now - self._shown < REFRESH:
            return
        self._shown = now
        share = "" if fraction is None else f" {fraction:4.0%}"
        line = f"{self._text}{share} {note}".rstrip()
        sys.stderr.write("\r" + line.ljust(self._wide))
        sys.stderr.flush()
        self._wide = len(line)

    def warn(self, text: str) -> None:
        """A line that stays, terminal or not."""
        self._wipe()
        sys.stderr.write(f"warning: {text}\n")
        sys.stderr.flush()

    def __enter__(self) -> "Progress":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._wipe()

    def _wipe(self) -> None:
        if self._wide:
            sys.stderr.write("\r" + " " * self._wide + "\r")
            sys.stderr.flush()
            self._wide = 0
