"""What commands say on stderr about findings and times."""

import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from trunnion.pipeline import Timings
    from trunnion_core.findings import Finding

SHOWN_PER_CODE = 5
"""Findings of one code that are printed; the rest are counted."""


def print_findings(findings: Iterable["Finding"]) -> None:
    """One line each, on stderr; of a code that repeats, the first few and a count."""
    seen: dict[str, int] = {}
    for finding in findings:
        seen[finding.code] = seen.get(finding.code, 0) + 1
        if seen[finding.code] <= SHOWN_PER_CODE:
            where = "" if finding.line is None else f"line {finding.line}: "
            print(f"{finding.severity}: {finding.code}: {where}{finding.message}", file=sys.stderr)
    for code, count in seen.items():
        if count > SHOWN_PER_CODE:
            print(f"... and {count - SHOWN_PER_CODE} more of {code}", file=sys.stderr)


def print_timings(timings: "Timings") -> None:
    """A row a stage, and the sum."""
    for stage, seconds in timings.seconds.items():
        print(f"{stage:24} {seconds:8.3f} s", file=sys.stderr)
    print(f"{'sum':24} {sum(timings.seconds.values()):8.3f} s", file=sys.stderr)
