"""The JUnit XML holds what the common schema of its readers allows, whatever bytes a broken program quotes."""

from pathlib import Path
from xml.etree import ElementTree

from trunnion.junit import junit_xml
from trunnion_core.profile import load_profile
from trunnion_sim.judge import judge
from trunnion_sim.registry import all_codes

ALLOWED = {
    "testsuite": {"name", "tests", "failures", "errors"},
    "testcase": {"name", "classname"},
    "failure": {"message", "type"},
    "system-out": set(),
}
"""Elements and attributes, a part of junit-10.xsd of Jenkins' xUnit plugin."""


def test_the_xml_keeps_to_the_schema_and_counts_right(tmp_path: Path) -> None:
    program = tmp_path / "a.gcode"
    program.write_bytes(b"G28\nG1 X\x00\x0b500 F600\nG1 X300 F600\n\xff\xfe]]>\nM104 S200\nG1 X1 E5\nG1 X\x01")
    suite = ElementTree.fromstring(junit_xml(judge(program, load_profile("generic_3axis")), "a\x02<&>.gcode", 'm"'))
    for element in suite.iter():
        assert set(element.attrib) <= ALLOWED[element.tag]
    cases = {case.attrib["name"]: case for case in suite}
    assert set(cases) == set(all_codes())
    failing = {name for name, case in cases.items() if case.find("failure") is not None}
    assert {"joint-limit", "unreadable", "cold-extrusion", "torn-file"} <= failing
    assert (suite.attrib["tests"], suite.attrib["failures"]) == (str(len(cases)), str(len(failing)))
    assert cases["heater-left-on"].find("failure") is None
    assert "200" in (cases["heater-left-on"].findtext("system-out") or "")
    assert "line 3" in (cases["joint-limit"].findtext("failure") or "")
