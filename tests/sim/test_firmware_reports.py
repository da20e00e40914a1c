"""Texts of reports, each as the named file of Marlin 2.1.2.5 prints it."""

import pytest

from trunnion_core.profile import load_profile
from trunnion_sim.firmware.machine import SoftwareMachine


def ask(name: str, *lines: str) -> str:
    """What the machine says to the last of the lines."""
    machine = SoftwareMachine(load_profile(name), speed=None)
    machine.take()
    said = b""
    for line in lines:
        machine.receive(line.encode() + b"\n")
        said = b""
        while b"ok\n" not in said:
            said += machine.advance(0.0)
    return said.decode()


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("M92", "  M92 X80.00 Y80.00 Z400.00 A44.44 B44.44 E"),
        ("M203", "  M203 X200.00 Y200.00 Z40.00 A180.00 B180.00 E60.00\n"),
        ("M201", "  M201 X2000.00 Y2000.00 Z500.00 A1800.00 B1800.00 E3000.00\n"),
        ("M204", "  M204 P"),
        ("M205", "  M205 B20000.00 S0.00 T0.00 X8.00 Y8.00 Z4.00 A8.00 B8.00 E10.00\n"),
        ("M211", "  M211 S1 ; ON\n  Min:  X-160.00 Y-160.00 Z-80.00 A-60.00 B-60.00   Max:  X160.00 Y160.00 Z220.00"),
    ],
)
def test_a_report_asked_for_by_its_own_code_has_no_heading_and_no_echo(code: str, said: str) -> None:
    """`M92_report(forReplay=true)` and its like: `report_heading_etc` prints nothing before them."""
    answer = ask("generic_ab_cradle", code)
    assert answer.startswith(said)
    assert answer.endswith("\nok\n")


def test_m503_says_the_same_with_headings_and_with_s0_without() -> None:
    """`settings.cpp`: `MarlinSettings::report(!parser.boolval('S', true))`."""
    full, bare = ask("generic_ab_cradle", "M503"), ask("generic_ab_cradle", "M503 S0")
    lines = full.splitlines()
    assert lines[0] == "echo:; Linear Units:"
    assert all(line.startswith("echo:") for line in lines[:-1])
    assert [line[5:] for line in lines[:-1] if not line.startswith("echo:;")] == bare.splitlines()[:-1]


def test_axes_are_reported_in_the_firmware_s_order_whatever_the_profile_s() -> None:
    """`report_logical_position` and `M92_report` list X, Y, Z, then the fourth axis and so on."""
    assert load_profile("rep5x_ender3").letters[1] != "Y"
    where = ask("rep5x_ender3", "G0 X10 Y20 Z3 F3000", "M400", "M114")
    assert where.startswith("X:10.00 Y:20.00 Z:3.00 A:0.00 B:0.00 E:0.00 Count X:")
    assert [word[0] for word in where.split("Count ")[1].split("\n")[0].split()] == list("XYZAB")
    assert [word[0] for word in ask("rep5x_ender3", "M92").split()[1:-1]] == list("XYZABE")


def test_the_feed_percentage_is_whole_and_can_be_kept_and_brought_back() -> None:
    """`M220.cpp`: `value_int`, B and R."""
    assert ask("generic_ab_cradle", "M220") == "FR:100%\nok\n"
    assert ask("generic_ab_cradle", "M220 S97.8", "M220") == "FR:97%\nok\n"
    assert ask("generic_ab_cradle", "M220 S50", "M220 B", "M220 S200", "M220 R", "M220") == "FR:50%\nok\n"
    assert ask("generic_ab_cradle", "M221 S95.9", "M221") == "echo:E0 Flow: 95%\nok\n"
