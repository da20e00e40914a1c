"""The judge's surface on cases whose answer is known: a table of what was expected and what was measured.

    python bench/shape.py [--picture docs/pictures/shape.png] > docs/shape.md

The expected figures come from another road: the outline of round beads (stadium sections, Slic3r's flow model) drawn
as a dense polyline across the lines, and distances between it and the model's line. Each case is measured at the
judge's own grid, 12 cells across a bead, and at half of it.
"""

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from trunnion_core.arrays import BoolArray, FloatArray
from trunnion_core.bead import bead_area, bead_spacing
from trunnion_core.mesh import Mesh
from trunnion_sim.report import SurfaceReport
from trunnion_sim.surface.compare import compare, heights
from trunnion_sim.surface.deposit import Deposit, Pieces, lay_down

W = 0.4
LONG, DEEP = 8.0, 10.0
BEYOND = 2.0
"""mm of beads beyond the model's borders."""
WALL = 5.0
"""mm, outer radius of the round wall."""
FINE = 0.001
"""mm between points of the expected outlines."""
EXPLANATION = """
![Cuts across the lines: round beads and what the judge has](pictures/shape.png)

**Stairs.** Square stairs of layers h cut at their middle are h/4 cos from the ramp on average. Back from the ramp the
nearest spot is a tread or a riser, h/4 / (1 + slope) on average: together h/4 (cos + 1 / (1 + slope)), 0.150 mm at
slope 0, 0.136 at 0.2 and 0.126 at 0.364 for layers of 0.3. The figure of h/2 cos, 0.145 mm, has points on treads only,
none on risers. That is why a part with slopes up to 0.75 reads 0.12 mm when it is printed planar. Round edges and the
grooves on the treads, which are in the expected column, change these figures by less than 0.006 mm.

**Left out.** Vertical walls: a height field has no points there, but it has the wall's outline.
"""
HEAD = "| case | figure | expected | measured | on half the grid | change |\n|---|---|---|---|---|---|"


@dataclass(frozen=True)
class Lines:
    """Lines along x, in order: y, z of the path, the slope of the surface that they lie on, section."""

    y: FloatArray
    z: FloatArray
    slope: float
    height: float
    flow: float = 1.0

    @property
    def area(self) -> float:
        """mm²."""
        return self.flow * float(bead_area(np.array(W), np.array(self.height)))


def main() -> None:
    """Print the table as Markdown; draw the picture."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--picture", type=Path)
    chosen = options.parse_args()
    print("# Shape: what the judge measures where the answer is known\n")
    print("Written by `bench/shape.py`. Beads 0.4 mm wide, lengths in mm; Chamfer is both ways together.\n")
    print(HEAD)
    for height in (0.15, 0.2, 0.3):
        report_case(f"flat plate, layers of {height}", [skin(0.0, height)], 0.0, height)
    for slope in (0.1, 0.2, 0.364, 0.75):
        report_case(f"conformal skin, slope {slope}", [skin(slope, 0.3)], slope, 0.3)
    for slope in (0.05, 0.1, 0.2, 0.364, 0.6):
        report_case(f"planar stairs, slope {slope}", stairs(slope, 0.3), slope, 0.3, ground=False)
    report_case("planar stairs, slope 0.2, layers of 0.15", stairs(0.2, 0.15), 0.2, 0.15, ground=False)
    planted()
    row("cylinder wall, radius 5", "outer radius", WALL, *(wall_radius(W / cells) for cells in (12, 24)))
    print(EXPLANATION, end="")
    if chosen.picture:
        draw(chosen.picture)


def report_case(title: str, lines: list[Lines], slope: float, height: float, ground: bool = True) -> None:
    """One row: Chamfer expected, measured, on half the grid."""
    there, back = expected(lines, slope)
    figures = [measured(lines, slope, height, W / cells, ground)[1].chamfer for cells in (12, 24)]
    row(title, "Chamfer", there + back, figures[0], figures[1])


def row(title: str, figure: str, expect: float, coarse: float, fine: float) -> None:
    """Print one row."""
    print(f"| {title} | {figure} | {expect:.4f} | {coarse:.4f} | {fine:.4f} | {fine / coarse - 1:+.1%} |", flush=True)


def planted() -> None:
    """Errors put into a plate of layers of 0.3, and what they must change."""
    height, plate = 0.3, skin(0.0, 0.3)
    floor = expected([plate], 0.0)[0]
    rng = np.random.default_rng(3)
    noise = rng.normal(0.0, 0.02, len(plate.y))
    inner = (plate.y > 1) & (plate.y < DEEP - 1)
    tops = [
        heights(measured([noisy(plate, noise)], 0.0, height, W / cells)[0].field, crests(plate, inner))
        for cells in (12, 24)
    ]
    row("height noise, 0.02 standard deviation", "deviation of crests", noise[inner].std(), *(t.std() for t in tops))
    for flow in (0.9, 1.1, 1.2):
        lines = Lines(plate.y, plate.z, 0.0, height, flow)
        deposits = [measured([lines], 0.0, height, W / cells)[0] for cells in (12, 24)]
        share = [d.balance.kept / (d.balance.fed - d.balance.beyond) for d in deposits]
        row(f"flow {flow:.0%}", "plastic kept / fed", 1.0, *share)
    gap = len(plate.y) // 2
    missing = Lines(np.delete(plate.y, gap), np.delete(plate.z, gap), 0.0, height)
    both = [measured([missing], 0.0, height, W / cells)[1] for cells in (12, 24)]
    row("a line left out", "mean depth", expected([missing], 0.0)[0], *(np.abs(r.deviation).mean() for r in both))
    for low in (0.05, 0.1):
        sunk = Lines(plate.y, plate.z - low, 0.0, height)
        both = [measured([sunk], 0.0, height, W / cells, sink=low)[1] for cells in (12, 24)]
        rim = 2 * (LONG + DEEP) * low**2 / 2 / (LONG * DEEP)
        row(f"all {low} too low", "mean depth", low + floor - rim, *(np.abs(r.deviation).mean() for r in both))


def wall_radius(cell: float) -> float:
    """mm: radius of the disc as large as all that is inside the outline of a round wall, ten layers of 0.3 high."""
    height, count = 0.3, 720
    turn = np.linspace(0.0, 2 * np.pi, count + 1)
    radius = (WALL - W / 2) / math.cos(math.pi / count)
    ring = np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])
    rings = [np.column_stack([ring, np.full(count + 1, (k + 1) * height)]) for k in range(10)]
    start, end = (np.concatenate([at[cut] for at in rings]) for cut in (slice(0, -1), slice(1, None)))
    way = np.linalg.norm(end - start, axis=1)
    volume = way * bead_area(np.array(W), np.array(height))
    n = len(start)
    axis = np.tile([0.0, 0.0, 1.0], (n, 1))
    pieces = Pieces(np.arange(n), start, end, axis, volume, np.ones(n, dtype=bool))
    corner = np.full(2, WALL + 1.0)
    field = lay_down(pieces, n, -corner, corner, cell, 0.8, 0.4).field
    ny, nx = field.top.shape
    x, y = field.x + cell * np.arange(nx), field.y + cell * np.arange(ny)
    inside = np.hypot(x[None, :], y[:, None]) < WALL - W / 2
    return math.sqrt(float(np.count_nonzero(inside | (field.top > 9 * height))) * cell**2 / math.pi)


def skin(slope: float, height: float) -> Lines:
    """One layer along the ramp z = 7 + slope y, tools on its normal, at the pitch that fills it."""
    turn = math.hypot(1, slope)
    pitch = bead_spacing(W, height) / turn
    y = np.arange(-BEYOND, DEEP + BEYOND, pitch)
    return Lines(y, 7 + slope * y, slope, height)


def stairs(slope: float, height: float) -> list[Lines]:
    """Planar layers up to the ramp z = 1 + slope y, cut where it passes their middle."""
    layers = []
    for k in range(math.ceil((1 + slope * DEEP) / height)):
        edge = max(-BEYOND, ((k + 0.5) * height - 1) / slope) + W / 2
        y = np.arange(edge, DEEP + BEYOND, bead_spacing(W, height))
        layers.append(Lines(y, np.full(len(y), (k + 1) * height), 0.0, height))
    return [layer for layer in layers if len(layer.y)]


def noisy(lines: Lines, by: FloatArray) -> Lines:
    """The lines moved up and down."""
    return Lines(lines.y, lines.z + by, lines.slope, lines.height, lines.flow)


def crests(lines: Lines, chosen: BoolArray) -> FloatArray:
    """(n, 2) points on the lines' middles."""
    return np.column_stack([np.full(int(chosen.sum()), LONG / 2), lines.y[chosen]])


def expected(lines: list[Lines], slope: float) -> tuple[float, float]:
    """Mean distance of the beads' outline to the model, and of the model to it, over y from 0 to DEEP."""
    y = np.arange(-BEYOND, DEEP + BEYOND, FINE)
    z = outline(lines, y)
    inside = (y >= 0) & (y <= DEEP)
    base = (7.0 if lines[0].slope or len(lines) == 1 else 1.0) + slope * y
    there = np.abs(z - base)[inside].mean() / math.hypot(1, slope)
    spots = [np.column_stack([y, z])]
    for at in np.flatnonzero(np.abs(np.diff(z)) > FINE):  # risers
        rise = np.linspace(z[at], z[at + 1], math.ceil(abs(z[at + 1] - z[at]) / FINE))
        spots.append(np.column_stack([np.full(len(rise), y[at]), rise]))
    back, _ = cKDTree(np.concatenate(spots)).query(np.column_stack([y, base])[inside])
    return float(there), float(np.mean(back))


def outline(lines: list[Lines], y: FloatArray) -> FloatArray:
    """Upper outline of stadiums over y; the ground 7 - 0.3 below where a ramp's skin leaves a gap."""
    z = np.full(len(y), -1.0)
    for layer in lines:
        turn = math.hypot(1, layer.slope)
        half = W / 2 if layer.flow == 1 else (layer.area / layer.height + (1 - math.pi / 4) * layer.height) / 2
        if len(lines) == 1:
            z = np.maximum(z, 7 + layer.slope * y - layer.height * turn)
        for yk, zk in zip(layer.y, layer.z, strict=True):
            near = np.abs(y - yk) * turn < half
            u = np.abs(y[near] - yk) * turn - (half - layer.height / 2)
            r = layer.height / 2
            down = np.where(u > 0, r - np.sqrt(np.maximum(r * r - np.maximum(u, 0) ** 2, 0)), 0)
            z[near] = np.maximum(z[near], zk + layer.slope * (y[near] - yk) - down * turn)
    return z


def measured(
    lines: list[Lines], slope: float, height: float, cell: float, ground: bool = True, sink: float = 0.0
) -> tuple[Deposit, SurfaceReport]:
    """The judge's deposit and report. With `ground` the first layer lies on a ramp of its own."""
    starts, ends, axes, volumes = [], [], [], []
    for layer in lines:
        turn = math.hypot(1, layer.slope)
        n = len(layer.y)
        x = np.where(np.arange(n) % 2 == 0, -BEYOND, LONG + BEYOND)
        starts.append(np.column_stack([x, layer.y, layer.z]))
        ends.append(np.column_stack([LONG - x, layer.y, layer.z]))
        axes.append(np.tile([0.0, -layer.slope / turn, 1 / turn], (n, 1)))
        volumes.append(np.full(n, layer.area * (LONG + 2 * BEYOND)))
    n = sum(map(len, volumes))
    start, end, axis = (np.concatenate(part) for part in (starts, ends, axes))
    pieces = Pieces(np.arange(n), start, end, axis, np.concatenate(volumes), np.ones(n, dtype=bool))
    low, high = np.array([-1.0, -1.0]), np.array([LONG + 1.0, DEEP + 1.0])
    base = 7.0 if ground else 1.0
    below = base - sink - height * math.hypot(1, slope)

    def floor(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(0 * x + below + slope * y)

    deposit = lay_down(pieces, n, low, high, cell, 0.8, 0.4, floor if ground else None)
    report = compare(deposit.field, ramp(slope, base), 60.0, height)
    if report is None:
        raise SystemExit("nothing to compare")
    return deposit, report


def ramp(slope: float, base: float) -> Mesh:
    """A block whose top is the plane z = base + slope y."""
    low: list[list[float]] = [[0, 0, 0], [LONG, 0, 0], [LONG, DEEP, 0], [0, DEEP, 0]]
    high = [[x, y, base + slope * y] for x, y, _ in low]
    faces = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]
    for a in range(4):
        b = (a + 1) % 4
        faces += [[a, b, b + 4], [a, b + 4, a + 4]]
    return Mesh(np.array(low + high, dtype=np.float64), np.array(faces, dtype=np.int64))


def draw(path: Path) -> None:
    """Cuts across the lines: the judge's surface over the expected outline."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 6), dpi=80)
    FigureCanvasAgg(figure)
    y = np.arange(3.0, 7.0, 0.002)
    cases: list[tuple[str, list[Lines], float, bool]]
    cases = [("conformal skin, slope 0.364", [skin(0.364, 0.3)], 0.364, True)]
    cases += [("planar stairs, slope 0.2", stairs(0.2, 0.3), 0.2, False)]
    for axes, (title, lines, slope, ground) in zip(figure.subplots(2, 1), cases, strict=True):
        deposit, _ = measured(lines, slope, 0.3, W / 12, ground)
        base = (7.0 if ground else 1.0) + slope * y
        axes.plot(y, outline(lines, y) - base, "k", lw=0.8, label="round beads")
        found = heights(deposit.field, np.column_stack([np.full(len(y), 4.1), y]))
        axes.plot(y, found - base, "r", lw=0.8, label="judge")
        axes.set_title(title)
        axes.set_ylabel("mm above the model")
        axes.legend()
    figure.tight_layout()
    figure.savefig(path, metadata={"Software": None}, pil_kwargs={"optimize": True})


if __name__ == "__main__":
    main()
