"""Every finding code fires on its named mutation of a good program, and the good program has none.

Run as a script it prints `docs/mutations.md`.
"""

import dataclasses
import difflib
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest

from trunnion_core.bead import bead_area, bead_spacing
from trunnion_core.profile import MachineProfile, load_profile
from trunnion_sim.judge import judge
from trunnion_sim.registry import all_codes, code_table

HEIGHT, WIDTH, SIZE, SPEED = 0.3, 0.4, 8.0, 40.0
SECTION = float(bead_area(np.array(WIDTH), np.array(HEIGHT)))
PITCH = bead_spacing(WIDTH, HEIGHT)
PER_MM = SECTION / (np.pi / 4 * 1.75**2)


def plate(layers: int = 3) -> list[str]:
    """A solid plate of crossed lines: a program that nobody has anything against."""
    text = ["; machine = generic_ab_cradle", "; firmware = marlin", "; filament_diameter = 1.75"]
    text += ["G21", "G90", "M83", "G28", "M104 S210", "M109 S210"]
    lines = int(SIZE / PITCH)
    for k in range(layers):
        z = (k + 1) * HEIGHT
        text += [";LAYER_CHANGE", f";Z:{z:.3f}", ";TYPE:Solid infill"]
        text += [f";WIDTH:{WIDTH}", f";HEIGHT:{HEIGHT}", f";SPEED:{SPEED}"]
        for j in range(lines):
            along = (0.0, SIZE) if j % 2 == 0 else (SIZE, 0.0)
            across = WIDTH / 2 + j * PITCH
            a, b = ((along[0], across), (along[1], across)) if k % 2 == 0 else ((across, along[0]), (across, along[1]))
            if j == 0:
                text += [";ROLE:travel", "G1 E-0.8 F1800", f"G0 Z{z + 1:.4f} F2000"]
                text += [
                    f"G0 X{a[0]:.4f} Y{a[1]:.4f} A0 B0 F6000",
                    f"G0 Z{z:.4f} F2000",
                    ";ROLE:prime",
                    "G1 E0.8 F1800",
                ]
                text += [";ROLE:solid_infill"]
            else:
                text += [f"G1 X{a[0]:.4f} Y{a[1]:.4f} E{PER_MM * PITCH:.5f} F{SPEED * 60:.0f}"]
            text += [f"G1 X{b[0]:.4f} Y{b[1]:.4f} E{PER_MM * SIZE:.5f} F{SPEED * 60:.0f}"]
    return [*text, ";ROLE:retract", "G1 E-0.8 F1800", ";ROLE:travel", "G0 Z30 F2000", "M104 S0", "M84"]


GOOD = plate()
FIRST = next(i for i, line in enumerate(GOOD) if line.startswith("G1 X8"))
LAST = max(i for i, line in enumerate(GOOD) if line.startswith("G1 X"))
BEAD = f"E{PER_MM * SIZE:.5f}"
LIFTED = GOOD.index("G0 Z30 F2000") + 1


def with_line(at: int, *new: str) -> list[str]:
    return [*GOOD[:at], *new, *GOOD[at:]]


def with_text(at: int, old: str, new: str) -> list[str]:
    assert old in GOOD[at]
    return [*GOOD[:at], GOOD[at].replace(old, new), *GOOD[at + 1 :]]


def everywhere(old: str, new: str) -> list[str]:
    assert any(old in line for line in GOOD)
    return [line.replace(old, new) for line in GOOD]


def without(start: str) -> list[str]:
    assert any(line.startswith(start) for line in GOOD)
    return [line for line in GOOD if not line.startswith(start)]


MIDDLE = GOOD.index(";ROLE:travel", FIRST) - 1
HANGING = [";ROLE:travel", "G0 X20 Y0 Z8 F2000", ";ROLE:solid_infill", f"G1 X28 {BEAD} F2400"]
RIMS = [
    line
    for z in (1.2, 1.5, 1.8)
    for line in (
        *(";ROLE:travel", f"G0 Z{z + 1:.1f} F2000", "G0 X1 Y0 F6000", f"G0 Z{z:.1f} F2000", ";ROLE:solid_infill"),
        *(f"G1 Y8 {BEAD} F2400", f"G1 X5.5 E{PER_MM * 4.5:.5f}", f"G1 Y0 {BEAD}"),
    )
]
DROOPING = [
    *(*RIMS, ";ROLE:travel", "G0 Z3 F2000", "G0 X3.2 Y2 F6000", "G0 Z1.8 F2000"),
    *(";ROLE:solid_infill", f"G1 Y5 E{PER_MM * 3:.5f} F2400"),
]
TINY = [f"G1 X{8 + i * 0.03:.4f} Y7.7500 Z0.9000 A0.0000 B0.0000 E0.00126 F2400" for i in range(400)]

OTHER_FIRMWARE = {"extrusion-refused": "klipper"}
"""Findings that only other firmware than the profile's can cause."""

MUTATIONS: dict[str, list[str]] = {
    "joint-limit": with_line(LIFTED, "G0 X161 F6000"),
    "winding-limit": with_line(LIFTED, "G0 A61 F6000"),
    "joint-speed": with_line(LIFTED, "G0 A30 F18000"),
    "joint-speed-clamped": with_line(LIFTED, "G0 Z60 F6000"),
    "joint-acceleration": with_line(7, "M201 X9000 Y9000"),
    "corner-raised": with_line(7, "M205 X30 Y30"),
    "tip-too-fast": with_text(FIRST, "F2400", "F4800"),
    "tip-too-slow": everywhere("F2400", "F600"),
    "extrusion-at-rest": with_line(FIRST + 1, "G1 E3 F300"),
    "purge-at-rest": with_line(GOOD.index("M109 S210") + 1, "G1 E8 F300"),
    "bead-without-plastic": with_text(FIRST, f" {BEAD}", ""),
    "extruding-travel": with_text(GOOD.index("G0 Z30 F2000"), "G0 Z30", "G1 Y20 E1"),
    "extrusion-refused": with_text(FIRST, BEAD, "E3"),
    "flow-off": with_text(FIRST, BEAD, f"E{PER_MM * SIZE * 1.25:.5f}"),
    "flow-wrong": with_text(FIRST, BEAD, f"E{PER_MM * SIZE * 2:.5f}"),
    "flow-too-high": everywhere("F2400", "F9000"),
    "nozzle-below-bed": with_text(FIRST, " F2400", " Z-0.05 F2400"),
    "bead-off-bed": [re.sub(r"X([\d.]+)", lambda x: f"X{float(x[1]) + 100:.4f}", line) for line in GOOD],
    "unknown-command": with_line(LIFTED, "M1234"),
    "unknown-word": with_line(LIFTED, "G0 C30"),
    "unreadable": with_line(LIFTED, "G0 X1\x00\x01"),
    "bad-number": with_line(LIFTED, "G0 X1..5"),
    "bare-word": with_line(LIFTED, "G0 X Y3"),
    "repeated-word": with_line(LIFTED, "G0 X1 X2"),
    "bad-checksum": with_line(LIFTED, "N7 G0 X1*3"),
    "line-too-long": with_line(LIFTED, "G0 X1." + "0" * 90),
    "bad-arc": with_line(LIFTED, "G2 X9 Y9 I1 J5"),
    "cold-extrusion": without("M109"),
    "too-hot": with_line(7, "M140 S300"),
    "heater-left-on": without("M104 S0"),
    "motion-before-homing": without("G28"),
    "relative-before-homing": with_line(3, "G91", "G0 Z5 F600", "G90"),
    "relative-printing": with_line(MIDDLE, "G91", f"G1 X0 Y0 Z0.01 {BEAD}", "G90", "M83"),
    "rotary-reset": with_line(LIFTED, "G92 B10"),
    "offset": with_line(LIFTED, "G92 Z10"),
    "extruder-mode-undone": with_line(7, "G90"),
    "inverse-time-unknown": with_line(LIFTED, "G93", "G0 X3 F60", "G94"),
    "wrong-machine": everywhere("generic_ab_cradle", "open5x_voron0"),
    "wrong-firmware": everywhere("firmware = marlin", "firmware = reprapfirmware"),
    "wrong-filament": everywhere("filament_diameter = 1.75", "filament_diameter = 2.85"),
    "other-limits": with_line(3, "; the plan relies on M203 X200 Y300 Z40 A180 B180 E60"),
    "planner-starved": with_line(LAST + 1, *TINY),
    "bead-in-air": with_line(GOOD.index(";ROLE:retract"), *HANGING),
    "hanging-bead": with_line(GOOD.index(";ROLE:retract"), *DROOPING),
    "long-bridge": with_line(
        GOOD.index(";ROLE:retract"),
        f"G1 X40 Z0.9 E{PER_MM * 38:.5f} F2400",
    ),
    "bead-over-bead": with_line(FIRST + 1, f"G1 X0 {BEAD} F2400", f"G1 X8 {BEAD} F2400"),
    "crowded-bead": everywhere(f"Y{WIDTH / 2 + PITCH:.4f}", f"Y{WIDTH / 2 + 0.35 * PITCH:.4f}"),
    "travel-through-print": with_text(GOOD.index("G0 Z30 F2000"), "Z30", "X0 Y0 Z0.5"),
    "collision": with_line(LIFTED, "G0 X4 Y4 F6000", "G0 Z0.4 F2000"),
    "torn-file": [*GOOD[:-3], "G0 Z3"],
    "no-final-newline": GOOD,
}

WHOLE = {code: code not in ("torn-file", "no-final-newline") for code in MUTATIONS}
"""Whether the mutated file ends in a newline."""


@pytest.fixture(scope="module")
def cradle() -> MachineProfile:
    return load_profile("generic_ab_cradle")


def machine_for(code: str, profile: MachineProfile) -> MachineProfile:
    """The machine, under the firmware that the finding is about."""
    return dataclasses.replace(profile, firmware=OTHER_FIRMWARE.get(code, profile.firmware))


def codes(path: Path, lines: list[str], profile: MachineProfile, *, newline: bool = True) -> dict[str, int]:
    path.write_text("\n".join(lines) + ("\n" if newline else ""), encoding="utf-8")
    return judge(path, profile).counts


def test_the_good_program_has_no_findings(tmp_path: Path, cradle: MachineProfile) -> None:
    assert codes(tmp_path / "good.gcode", GOOD, cradle) == {}


@pytest.mark.parametrize("code", sorted(MUTATIONS))
def test_every_mutation_is_found(code: str, tmp_path: Path, cradle: MachineProfile) -> None:
    machine = machine_for(code, cradle)
    assert code in codes(tmp_path / "mutated.gcode", MUTATIONS[code], machine, newline=WHOLE[code])


def test_every_published_code_has_its_mutation() -> None:
    assert set(all_codes()) == set(MUTATIONS)


def test_the_published_table_is_current() -> None:
    published = Path(__file__).parents[2] / "docs" / "finding_codes.md"
    assert published.read_text(encoding="utf-8") == code_table()


def test_a_finding_says_where(tmp_path: Path, cradle: MachineProfile) -> None:
    path = tmp_path / "limit.gcode"
    path.write_text("\n".join(MUTATIONS["winding-limit"]) + "\n", encoding="utf-8")
    found = [f for f in judge(path, cradle).findings if f.code == "winding-limit"]
    assert [(f.line, f.axis, round(f.value or 0, 6), round(f.limit or 0, 6)) for f in found] == [
        (LIFTED + 1, "A", 61, 60)
    ]
    assert found[0].layer == 2
    assert found[0].point is not None
    assert np.isfinite(found[0].point).all()


def test_long_series_become_one_finding_with_a_count(tmp_path: Path, cradle: MachineProfile) -> None:
    path = tmp_path / "series.gcode"
    path.write_text("\n".join(everywhere("F2400", "F4800")) + "\n", encoding="utf-8")
    report = judge(path, cradle)
    fast = [f for f in report.findings if f.code == "tip-too-fast"]
    assert len(fast) <= 4
    assert report.counts["tip-too-fast"] > 60
    assert report.verdict == "fail"


def test_the_published_table_of_mutations_is_current() -> None:
    published = Path(__file__).parents[2] / "docs" / "mutations.md"
    assert published.read_text(encoding="utf-8") == mutation_table()


def mutation_table() -> str:
    """Markdown: every mutation, the finding that it should cause, whether it did, and what else was found."""
    cradle = load_profile("generic_ab_cradle")
    lines = [
        "# Mutations and findings",
        "",
        "A good program (a solid plate of three crossed layers on `generic_ab_cradle`) has no finding.",
        "Each row changes it as told and says whether the expected finding came, and which others the same mistake",
        "causes. Generated by `python tests/sim/test_judge_findings.py`; a test keeps it current.",
        "",
        "| expected | severity | change | fired | also |",
        "|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "program.gcode"
        found = codes(path, GOOD, cradle)
        lines.append(f"| none | | none | {'none' if not found else ', '.join(found)} | |")
        for code, program in sorted(MUTATIONS.items()):
            machine = machine_for(code, cradle)
            found = codes(path, program, machine, newline=WHOLE[code])
            others = ", ".join(f"`{other}`" for other in sorted(found) if other != code)
            change = described(program) if program != GOOD else "no newline after the last line"
            change += f", on {OTHER_FIRMWARE[code]}" if code in OTHER_FIRMWARE else ""
            fired = "yes" if code in found else "**no**"
            lines.append(f"| `{code}` | {all_codes()[code][0]} | {change} | {fired} | {others} |")
    return "\n".join(lines) + "\n"


def described(program: list[str]) -> str:
    """The first lines that differ from the good program, and how many more do."""
    steps = [s for s in difflib.SequenceMatcher(None, GOOD, program, autojunk=False).get_opcodes() if s[0] != "equal"]
    _, i0, i1, j0, j1 = steps[0]
    old, new = (
        " / ".join(f"`{line!a}`".replace("'", "") for line in part[:2]) for part in (GOOD[i0:i1], program[j0:j1])
    )
    more = sum(max(i1 - i0, j1 - j0) for _, i0, i1, j0, j1 in steps) - min(max(i1 - i0, j1 - j0), 2)
    text = f"{old} becomes {new}" if old and new else f"{old} is left out" if old else f"{new} is put in"
    return f"{text}, and {more} more lines" if more > 0 else text


if __name__ == "__main__":
    print(mutation_table(), end="")
