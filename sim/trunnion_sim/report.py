"""The judge's report: findings, trace, figures; and the JSON that programs read."""

import math
from collections import Counter
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from trunnion_core.arrays import FloatArray
from trunnion_core.findings import Finding
from trunnion_core.trace import Trace


@dataclass(frozen=True)
class JointUse:
    """What one joint did, in mm or degrees."""

    min: float
    max: float
    peak_speed: float
    peak_acceleration: float


@dataclass(frozen=True, eq=False)
class SurfaceReport:
    """What the beads leave behind, compared with the model."""

    points: FloatArray
    """(n, 3) mm in `part`: samples on the surface of the beads."""
    deviation: FloatArray
    """(n,) mm from the model, positive above it."""
    chamfer: float
    """mm; equation 12 of Shahid 2024: mean distance beads to model plus mean distance model to beads."""
    void_fraction: float
    """Plastic missing below the model's surface, as a share of the outermost layer."""
    overfill_fraction: float
    """Plastic above the model's surface, as a share of the outermost layer."""
    cell: float
    """mm of the height field."""

    @property
    def figures(self) -> dict[str, float | int]:
        """The figures under their JSON names."""
        size = np.abs(self.deviation)
        return {
            "chamfer_mm": self.chamfer,
            "rms_mm": float(np.sqrt(np.mean(size**2))),
            "p95_mm": float(np.percentile(size, 95)),
            "max_mm": float(size.max()),
            "samples": len(size),
            "void_fraction": self.void_fraction,
            "overfill_fraction": self.overfill_fraction,
        }


@dataclass(frozen=True, eq=False)
class Report:
    """The judgement of one program on one machine."""

    findings: tuple[Finding, ...]
    trace: Trace
    time: float
    """s from the first line to the last motion, homing at full speed and without heating."""
    filament: float
    """mm fed in all, retractions and their undoing cancelled."""
    volume: float
    """mm³ fed in all."""
    joints: dict[str, JointUse]
    tip_speed: dict[str, float | None]
    """Percentiles over the time of printing of tip speed over wanted speed; None where the program names no speed."""
    flow: dict[str, float]
    """mm³/s while printing: median over time, highest."""
    role: NDArray[np.int8]
    """(n,) of every row of the trace: a `Role`, or -1 where the program names none."""
    width: FloatArray
    """(n,) mm of the bead that the row lays, 0 where it lays none."""
    surface: SurfaceReport | None
    clearance: float | None = None
    """mm, smallest distance between bodies; None where it was not computed."""

    @property
    def verdict(self) -> Literal["pass", "fail"]:
        """fail where any finding is an error."""
        return "fail" if any(finding.severity == "error" for finding in self.findings) else "pass"

    @property
    def counts(self) -> dict[str, int]:
        """Offending rows or lines of every code."""
        counts: Counter[str] = Counter()
        for finding in self.findings:
            counts[finding.code] += finding.count
        return dict(sorted(counts.items()))

    def to_json(self) -> dict[str, Any]:
        """The report as JSON values: null for what is unknown, degrees for rotaries."""
        data: dict[str, Any] = {
            "verdict": self.verdict,
            "findings": [_finding(finding) for finding in self.findings],
            "counts": self.counts,
            "time_s": self.time,
            "filament_mm": self.filament,
            "volume_mm3": self.volume,
            "joints": {letter: vars(use) for letter, use in self.joints.items()},
            "tip_speed": self.tip_speed,
            "flow_mm3_s": self.flow,
            "clearance_mm": self.clearance,
        }
        if self.surface is not None:
            data["surface"] = self.surface.figures
        return data


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "code": finding.code,
        "severity": finding.severity,
        "line": finding.line,
        "row": finding.row,
        "layer": finding.layer,
        "axis": finding.axis,
        "value": _number(finding.value),
        "limit": _number(finding.limit),
        "point": None if finding.point is None else [_number(x) for x in finding.point],
        "message": finding.message,
    }


def _number(value: float | None) -> float | None:
    """JSON knows no infinity."""
    return value if value is not None and math.isfinite(value) else None
