"""A report as one self-contained page: the machine and the beads in 3D with a time slider, plots, findings.

The page's parts stand in `report_page/`; arrays go in compressed (gzip, base64), so that nothing is fetched.
"""

import base64
import gzip
import html
import json
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trunnion.pictures import DEVIATION_RANGE, ROLE_COLOURS
from trunnion_core.profile import MachineProfile
from trunnion_core.roles import Role
from trunnion_core.solid_tables import CylinderTable, HullTable, SolidTable
from trunnion_sim.report import Report

PARTS = Path(__file__).parent / "report_page"
MOST_ROWS = 600_000
"""Rows that the page is given; of a longer program the rest is told, not drawn."""
MOST_SAMPLES = 120_000
"""Deviation samples that the page is given."""
OTHER_COLOUR = "777777"


def report_page(report: Report, profile: MachineProfile, title: str) -> str:
    """The page's text."""
    data = report.to_json()
    surface = data.get("surface")
    facts = {
        "printed in": f"{data['time_s'] / 60:.1f} min",
        "filament": f"{data['filament_mm']:.0f} mm",
        "machine": profile.name,
    }
    if surface is not None:
        facts["Chamfer distance"] = f"{surface['chamfer_mm']:.4f} mm"
    if data["clearance_mm"] is not None:
        facts["clearance"] = f"{data['clearance_mm']:.2f} mm"
    if len(report.trace) > MOST_ROWS:
        facts["drawn"] = f"the first {MOST_ROWS} of {len(report.trace)} moves"
    return Template((PARTS / "page.html").read_text(encoding="utf-8")).substitute(
        title=html.escape(title),
        verdict=report.verdict,
        facts=" · ".join(f"{html.escape(key)} {html.escape(value)}" for key, value in facts.items()),
        style=(PARTS / "style.css").read_text(encoding="utf-8"),
        script=(PARTS / "viewer.js").read_text(encoding="utf-8"),
        data=json.dumps(_scene(report, profile, data["findings"])).replace("<", "\\u003c"),
    )


def _scene(report: Report, profile: MachineProfile, findings: list[dict[str, Any]]) -> dict[str, Any]:
    """What viewer.js reads: rows, joint chain, bodies, findings, deviation."""
    rows = slice(0, MOST_ROWS)
    trace = report.trace
    duration = np.diff(trace.time, prepend=0.0)
    length = np.linalg.norm(np.diff(trace.points, axis=0, prepend=trace.points[:1]), axis=1)
    moving = duration > 0
    speed = np.divide(length, duration, out=np.zeros(len(trace)), where=moving)
    flow = np.divide(np.maximum(trace.volume, 0), duration, out=np.zeros(len(trace)), where=moving & (report.width > 0))
    role = np.where(report.role >= 0, report.role, Role.TRAVEL)
    beads = trace.points[rows][report.width[rows] > 0]
    low, high = (beads.min(axis=0), beads.max(axis=0)) if len(beads) else (np.zeros(3), np.full(3, 10.0))
    scene = {
        "rows": {
            "time": _packed(trace.time[rows]),
            "line": _packed(trace.line[rows]),
            "points": _packed(trace.points[rows]),
            "axes": _packed((trace.tool_axes[rows] * 32767).astype(np.int16)),
            "joints": _packed(trace.joints[rows]),
            "width": _packed(report.width[rows]),
            "speed": _packed(speed[rows]),
            "flow": _packed(flow[rows]),
            "role": _packed(role[rows].astype(np.uint8)),
        },
        "joints": [
            {
                "letter": joint.letter,
                "side": joint.side,
                "rotary": joint.rotary,
                "axis": joint.axis.tolist(),
                "point": joint.point.tolist(),
                "shown": joint.shown(1.0),
            }
            for joint in profile.joints
        ],
        "tool": {
            "tip": profile.tip.tolist(),
            "axis": profile.tool_axis.tolist(),
            "body": [_drawn(solid) for solid in profile.tool_bodies],
        },
        "bodies": [{"solid": _drawn(body.solid), **_carriers(profile, body.carried_by)} for body in profile.bodies],
        "origin": profile.origin.tolist(),
        "work": [_plate(profile), *(_drawn(solid) for solid in profile.work_bodies)],
        "roles": [
            {
                "name": role_.text.replace("_", " "),
                "colour": ROLE_COLOURS.get(role_, f"#{OTHER_COLOUR}").lstrip("#"),
                "present": bool(((report.role == role_) & (report.width > 0)).any()),
            }
            for role_ in Role
        ],
        "middle": ((low + high) / 2).tolist(),
        "size": max(float(np.linalg.norm(high - low)), 10.0),
        "findings": [
            {**finding, "time": None if finding["row"] is None else float(trace.time[finding["row"]])}
            for finding in findings
        ],
        "deviation": None,
    }
    if report.surface is not None:
        step = max(1, len(report.surface.deviation) // MOST_SAMPLES)
        scene["deviation"] = {
            "points": _packed(report.surface.points[::step]),
            "value": _packed(report.surface.deviation[::step]),
            "range": DEVIATION_RANGE,
        }
    return scene


def _carriers(profile: MachineProfile, letter: str) -> dict[str, Any]:
    """The side whose joints carry a body, and how many of them, from the frame outwards."""
    sides = {joint.letter: joint.side for joint in profile.joints}
    side = sides.get(letter, "tool")
    letters = [joint.letter for joint in profile.joints if joint.side == side]
    return {"side": side, "joints": letters.index(letter) + 1 if letter in letters else 0}


def _drawn(solid: SolidTable) -> dict[str, Any]:
    """A solid as viewer.js draws it: its own numbers, or the triangles of a hull."""
    if not isinstance(solid, HullTable):
        return solid.model_dump()
    from scipy.spatial import ConvexHull

    points = np.array(solid.points)
    hull = ConvexHull(points)
    corners = points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * hull.equations[:, :3]).sum(axis=1) < 0
    corners[inward] = corners[inward][:, ::-1]
    return {"shape": "hull", "triangles": corners.tolist()}


def _plate(profile: MachineProfile) -> dict[str, Any]:
    """The bed as a solid in `part`."""
    bed = profile.bed
    if bed.min is not None and bed.max is not None:
        return {"shape": "box", "min": [*bed.min, -bed.thickness], "max": [*bed.max, 0.0]}
    diameter = bed.diameter or 1.0
    return CylinderTable(shape="cylinder", name="bed", bottom=-bed.thickness, top=0, diameter=diameter).model_dump()


def _packed(array: NDArray[Any]) -> dict[str, str]:
    """float32, int16 or uint8 bytes, little-endian, compressed; the same bytes for the same array."""
    kind = array.dtype.name if array.dtype.name in ("int16", "uint8") else "float32"
    raw = np.ascontiguousarray(array).astype(np.dtype(kind).newbyteorder("<")).tobytes()
    return {"type": kind, "data": base64.b64encode(gzip.compress(raw, 6, mtime=0)).decode("ascii")}
