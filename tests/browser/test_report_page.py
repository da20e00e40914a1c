"""The report page in a real browser: it draws the beads, the machine and the findings, offline and without an error."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from trunnion import samples
from trunnion.dry_run import check_program
from trunnion.html_report import report_page
from trunnion.pipeline import make_job, solid_part, write_job
from trunnion_core.profile import load_profile
from trunnion_core.settings import PrintSettings

pytestmark = pytest.mark.browser

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SOFTWARE_GL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
QUIET = ("--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync")


def browse(page: Path, *words: str, size: str = "1440,900") -> str:
    assert CHROMIUM, "no chromium on this machine; the browser tests need one"
    command = [CHROMIUM, "--headless", "--no-sandbox", *SOFTWARE_GL, *QUIET, "--virtual-time-budget=20000"]
    command += [f"--user-data-dir={page.parent / 'browser'}", f"--window-size={size}", "--enable-logging=stderr"]
    done = subprocess.run([*command, *words, page.as_uri()], capture_output=True, text=True, check=True, timeout=120)
    assert "CONSOLE" not in done.stderr, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A small part whose program is spoiled in one place: the nozzle is never heated enough."""
    folder = tmp_path_factory.mktemp("report")
    profile = load_profile("generic_ab_cradle")
    settings = PrintSettings.model_validate({**samples.settings("rib"), "fill_density": 0})
    job = make_job(solid_part("rib", samples.make("rib"), profile, settings), profile, settings)
    program = folder / "rib.gcode"
    write_job(job, program)
    program.write_text(program.read_text().replace("M109 S210", "M109 S100", 1))
    path = folder / "report.html"
    path.write_text(report_page(check_program(program, profile), profile, "rib"))
    return path


def test_the_page_comes_up_with_its_findings_and_legend(page):
    dom = browse(page, "--dump-dom")
    assert 'data-ready="yes"' in dom
    assert "cold-extrusion" in dom
    assert "nonplanar infill" in dom
    assert '<p id="verdict" class="fail">fail</p>' in dom


@pytest.mark.parametrize("size", ["1440,900", "390,844"])
def test_beads_and_plots_are_drawn(page, size, tmp_path):
    shot = tmp_path / "shot.png"
    browse(page, f"--screenshot={shot}", size=size)
    picture = imread(shot)[:, :, :3]
    red, green, blue = np.moveaxis(picture, 2, 0)
    skin = (red > 0.5) & (green < 0.35) & (blue < 0.45)
    walls = (red > 0.6) & (green > 0.3) & (green < 0.65) & (blue < 0.35)
    assert skin.sum() > 500
    assert walls.sum() > 100
    below = picture[int(len(picture) * 0.82) :]
    assert (below.max(axis=2) - below.min(axis=2) > 0.2).sum() > 500
