"""The five samples' toolpaths on the A-B cradle as one picture.

python bench/sample_pictures.py    writes docs/pictures/samples.png
"""

import tempfile
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread

from trunnion import samples
from trunnion.pictures import draw_toolpath
from trunnion.pipeline import make_job, solid_part
from trunnion_core.profile import load_profile
from trunnion_core.settings import PrintSettings

OUT = Path(__file__).parents[1] / "docs" / "pictures" / "samples.png"


def main() -> None:
    """Slice every sample and set its picture beside the others."""
    profile = load_profile("generic_ab_cradle")
    figure = Figure(figsize=(10, 5.6), dpi=100)
    FigureCanvasAgg(figure)
    places = figure.subplots(2, 3).ravel()
    with tempfile.TemporaryDirectory() as folder:
        for name, axes in zip(samples.names(), places, strict=False):
            settings = PrintSettings.model_validate(samples.settings(name))
            job = make_job(solid_part(name, samples.make(name), profile, settings), profile, settings)
            draw_toolpath(job.toolpath, Path(folder) / f"{name}.png", name)
            axes.imshow(imread(Path(folder) / f"{name}.png"), interpolation="antialiased")
    for axes in places:
        axes.axis("off")
    figure.tight_layout(pad=0.3)
    OUT.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(OUT, metadata={"Software": None})


if __name__ == "__main__":
    main()
