"""The main job: mesh, toolpath, program, print on the embedded machine, report; and what it promises on the way."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from trunnion import samples
from trunnion.dry_run import check_program
from trunnion.html_report import report_page
from trunnion.junit import junit_xml
from trunnion.pictures import draw_deviation, draw_joints, draw_toolpath
from trunnion.pipeline import Job, Timings, make_job, solid_part, write_job
from trunnion.printing import open_printer, print_program
from trunnion_core.profile import load_profile
from trunnion_core.roles import Role
from trunnion_core.settings import PrintSettings
from trunnion_core.toolpath import Toolpath
from trunnion_kinematics.chain import JointChain

CRADLE = "generic_ab_cradle"
MACHINES = ("generic_ab_cradle", "open5x_voron0", "rep5x_ender3", "open5x_prusa_i3")


def job_for(name: str, machine: str = CRADLE, **more: object) -> Job:
    profile = load_profile(machine)
    settings = PrintSettings.model_validate({**samples.settings(name), **more})
    return make_job(solid_part(name, samples.make(name), profile, settings), profile, settings)


def program_lines(path: Path) -> list[str]:
    """Commands of a file without comments and blank lines: what a firmware should execute."""
    return [text for line in path.read_text().splitlines() if (text := line.partition(";")[0].strip())]


@pytest.mark.parametrize("name", samples.names())
def test_a_sample_is_printed_line_for_line_on_the_embedded_machine(name, tmp_path):
    job = job_for(name)
    assert (job.toolpath.role == Role.NONPLANAR_INFILL).any()
    path = tmp_path / f"{name}.gcode"
    write_job(job, path)
    with open_printer("sim", job.profile) as printer:
        result = print_program(path, printer, job.profile)
        executed = printer.machine.executed
    assert result.reason == ""
    assert result.warnings == ()
    wanted = program_lines(path)
    sent = [line for line in executed if not re.match(r"M1(05|10|14|15)\b|M155|M503", line)]
    assert sent[: len(wanted)] == wanted
    trace = printer.machine.trace()
    chain = JointChain.from_profile(job.profile)
    low = job.toolpath.points[job.toolpath.extrudes].min(axis=0) - 0.05
    laid = trace.points[trace.volume > 0]
    assert (laid >= low).all()
    points, axes = chain.forward(trace.joints)
    np.testing.assert_allclose(points, trace.points, atol=1e-9)
    np.testing.assert_allclose(axes, trace.tool_axes, atol=1e-9)


def test_one_toolpath_is_the_same_motion_of_the_tip_on_every_machine():
    """Tip and tool axis in the part frame within 1e-6 mm and 1e-6 degrees at the toolpath's rows; the same plastic."""
    filament = []
    for machine in MACHINES:
        job = job_for("freeform", machine)
        program, path = job.program, job.toolpath
        points, axes = JointChain.from_profile(job.profile).forward(program.joints)
        # the last of a source row's pieces ends at the row's point
        rows = np.flatnonzero(program.source >= 0)
        last = rows[np.append(np.diff(program.source[rows]) != 0, True)]
        source = program.source[last]
        kept = path.extrudes[source]
        assert len(np.unique(source[kept])) == path.extrudes.sum()
        np.testing.assert_allclose(points[last][kept], path.points[source][kept], rtol=0, atol=1e-6)
        cosine = np.linalg.norm(np.cross(axes[last][kept], path.tool_axes[source][kept]), axis=1)
        assert np.degrees(cosine.max()) < 1e-6
        filament.append(program.filament[program.width > 0].sum())
    np.testing.assert_allclose(filament, filament[0], rtol=1e-12)


def test_the_same_input_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        write_job(job_for("propeller"), tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_nonplanar_beats_planar_on_the_freeform_part(tmp_path):
    """The paper's comparison: the same mesh and settings, threshold 0 means all planar."""
    chamfer = {}
    samples_path = tmp_path / "freeform.stl"
    from trunnion_slicer.mesh_io import write_stl

    write_stl(samples.make("freeform"), samples_path)
    for kind, more in (("nonplanar", {}), ("planar", {"nonplanar_max_angle": 0})):
        job = job_for("freeform", **more)
        write_job(job, tmp_path / f"{kind}.gcode")
        report = check_program(tmp_path / f"{kind}.gcode", job.profile, samples_path)
        assert report.surface is not None
        chamfer[kind] = report.surface.chamfer
    assert chamfer["planar"] > 0.12
    assert chamfer["nonplanar"] < chamfer["planar"] / 2


def test_reports_and_pictures_hold_what_they_promise(tmp_path):
    job = job_for("rib", fill_density=0)
    path = tmp_path / "rib.gcode"
    write_job(job, path, Timings())
    text = path.read_text().replace("M109 S210", "M109 S100", 1)
    path.write_text(text)
    report = check_program(path, job.profile)
    assert report.verdict == "fail"
    suite = ElementTree.fromstring(junit_xml(report, "rib.gcode", job.profile.name))
    failing = {case.get("name") for case in suite.iter("testcase") if case.find("failure") is not None}
    assert "cold-extrusion" in failing
    assert failing == {finding.code for finding in report.findings if finding.severity == "error"}
    assert int(suite.get("failures", "0")) == len(failing)
    page = report_page(report, job.profile, "rib <on> cradle")
    assert "rib &lt;on&gt; cradle" in page
    assert "http" not in page.replace("http://www.w3.org", "")
    match = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    assert match
    scene = json.loads(match[1])
    assert len(scene["findings"]) == len(report.findings)
    assert [joint["letter"] for joint in scene["joints"]] == list(job.profile.letters)
    draw_toolpath(job.toolpath, tmp_path / "t.png", "rib")
    draw_joints(report.trace, job.profile, tmp_path / "j.png", "rib")
    draw_deviation(report.trace.points, np.zeros(len(report.trace)), tmp_path / "d.png", "rib")
    for name in "tjd":
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_a_toolpath_file_gives_back_its_arrays(tmp_path):
    path = job_for("rib", fill_density=0).toolpath
    path.save(tmp_path / "t.npz")
    back = Toolpath.load(tmp_path / "t.npz")
    np.testing.assert_array_equal(back.points, path.points)
    np.testing.assert_array_equal(back.role, path.role)
