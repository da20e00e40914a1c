"""How near the printed skin comes to the model: every sample printed planar and along its skin, both judged alike.

    python bench/accuracy.py [--picture docs/pictures/deviation_freeform.png] [--machine generic_ab_cradle]

Same mesh, same settings, the same facets (those no steeper than equation 1 says, the arc tangent of height over width),
the judge of `trunnion check`. Chamfer distance is equation 12 of Shahid 2024 (arXiv 2411.07225); void and overfill are
shares of the outermost layer. The lower rows are the free-form part with other settings; where the head cannot reach
deeper layers the slicer prints fewer, and the rows agree.
"""

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from trunnion import samples
from trunnion.dry_run import check_program
from trunnion.pipeline import load_part, make_job, write_job
from trunnion_core.profile import load_profile
from trunnion_core.settings import PrintSettings
from trunnion_sim.report import SurfaceReport
from trunnion_slicer.mesh_io import write_stl

VARIANTS: dict[str, dict[str, Any]] = {
    "2 non-planar layers": {"nonplanar_layers": 2},
    "3 non-planar layers": {"nonplanar_layers": 3},
    "solid inside": {"fill_density": 100},
    "solid, layers of 0.2": {"fill_density": 100, "layer_height": 0.2},
    "solid, layers of 0.15": {"fill_density": 100, "layer_height": 0.15},
}
PLANAR = {"nonplanar_max_angle": 0}
HEAD = f"{'':24}{'':12}{'Chamfer':>9}{'RMS':>9}{'P95':>9}{'max':>9}{'void':>9}{'overfill':>9}{'ratio':>9}"
RANGE = 0.2
"""mm at the ends of the picture's colours."""
CELL = 0.15
"""mm of a pixel in the picture."""


def main() -> None:
    """Print two rows a sample, planar and non-planar, with the ratio of their Chamfer distances."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--picture", type=Path, help="where to draw the free-form part's deviation, both ways")
    options.add_argument("--machine", default="generic_ab_cradle")
    chosen = options.parse_args()
    print(HEAD)
    with tempfile.TemporaryDirectory() as folder:
        for name in samples.names():
            reports = pair(name, name, {}, chosen.machine, Path(folder))
            if name == "freeform" and chosen.picture:
                draw(reports, chosen.picture)
        for title, changes in VARIANTS.items():
            pair(title, "freeform", changes, chosen.machine, Path(folder))


def pair(title: str, name: str, changes: dict[str, Any], machine: str, folder: Path) -> dict[str, SurfaceReport]:
    """Both ways of printing one sample, printed as two rows of the table."""
    reports = {
        "planar": surface(name, changes | PLANAR, machine, folder),
        "non-planar": surface(name, changes, machine, folder),
    }
    base = reports["planar"].chamfer
    for way, report in reports.items():
        f = report.figures
        keys = ("chamfer_mm", "rms_mm", "p95_mm", "max_mm", "void_fraction", "overfill_fraction")
        numbers = "".join(f"{f[key]:9.4f}" for key in keys)
        print(f"{title:24}{way:12}{numbers}{report.chamfer / base:9.2f}", flush=True)
    return reports


def surface(name: str, changes: dict[str, Any], machine: str, folder: Path) -> SurfaceReport:
    """Slice, write, judge."""
    profile = load_profile(machine)
    settings = PrintSettings.model_validate(samples.settings(name) | changes)
    model, program = folder / f"{name}.stl", folder / f"{name}.gcode"
    write_stl(samples.make(name), model)
    write_job(make_job(load_part(model, profile, settings), profile, settings), program)
    report = check_program(program, profile, model).surface
    if report is None:
        raise SystemExit(f"{name}: no skin below the threshold angle")
    return report


def draw(reports: dict[str, SurfaceReport], path: Path) -> None:
    """Deviation of both ways, side by side from above, on one scale."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 4.2), dpi=80)
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(reports), sharey=True)
    for axes, (way, report) in zip(panels, reports.items(), strict=True):
        x, y = report.points[:, 0], report.points[:, 1]
        cells = [max(1, round(float(np.ptp(v)) / CELL)) for v in (x, y)]
        total, ex, ey = np.histogram2d(x, y, bins=cells, weights=report.deviation)
        count, _, _ = np.histogram2d(x, y, bins=cells)
        mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
        image = axes.imshow(
            mean.T,
            origin="lower",
            extent=(ex[0], ex[-1], ey[0], ey[-1]),
            cmap="RdBu_r",
            vmin=-RANGE,
            vmax=RANGE,
            interpolation="nearest",
        )
        axes.set_title(f"{way}: Chamfer {report.chamfer:.3f} mm")
        axes.set_xlabel("x, mm")
    panels[0].set_ylabel("y, mm")
    figure.colorbar(image, ax=list(panels), label="mm above (+) or below (-) the model", shrink=0.85)
    figure.savefig(path, bbox_inches="tight", metadata={"Software": None}, pil_kwargs={"optimize": True})


if __name__ == "__main__":
    main()
