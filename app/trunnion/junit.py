"""A report as JUnit XML, which every CI system reads: a test case for each finding code, failing where it was found."""

from xml.etree.ElementTree import Element, SubElement, indent, tostring

from trunnion_sim.registry import all_codes
from trunnion_sim.report import Report

UNREPRESENTABLE = dict.fromkeys([*range(9), 11, 12, *range(14, 32), 0xFFFE, 0xFFFF], "\ufffd")
"""Characters that XML 1.0 cannot hold; a broken program may quote them."""


def junit_xml(report: Report, program: str, machine: str) -> str:
    """The XML text. Errors are failures; warnings and notes stand in the case's output."""
    found: dict[str, list[str]] = {}
    for finding in report.findings:
        where = "" if finding.line is None else f"line {finding.line}: "
        found.setdefault(finding.code, []).append(f"{where}{finding.message}".translate(UNREPRESENTABLE))
    codes = all_codes()
    failing = [code for code in found if codes[code][0] == "error"]
    suite = Element(
        "testsuite",
        name=f"trunnion check {program} on {machine}".translate(UNREPRESENTABLE),
        tests=str(len(codes)),
        failures=str(len(failing)),
        errors="0",
    )
    for code, (severity, meaning) in codes.items():
        case = SubElement(suite, "testcase", classname=f"trunnion.{severity}", name=code)
        text = "\n".join(found.get(code, ()))
        if code in failing:
            SubElement(case, "failure", message=meaning, type=code).text = text
        elif text:
            SubElement(case, "system-out").text = text
    indent(suite)
    return tostring(suite, encoding="unicode", xml_declaration=True) + "\n"
