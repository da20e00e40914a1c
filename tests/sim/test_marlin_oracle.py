"""Job times against figures from a rendering of Marlin's own source, measured outside this repository.

The figures come from a C++ program that follows Marlin 2.1.2.5 line by line, in its single-precision floats and 32-bit
integers: `planner.cpp` (`_populate_block`, `recalculate` with its planned pointer and busy block, 16 blocks, slow-down
of a draining queue, `calculate_trapezoid_for_block`) and `stepper.cpp` (`block_phase_isr` with the timer at 2 MHz, one
step an interrupt; the first block is held back as `get_current_block` does it, polled every millisecond). It shares
no code and no author's habit with the machine or the judge: it reads the same lines and says when the last step falls.

The machine makes every step as the firmware does and must agree within 0.2 %: what remains is single precision. The
judge's ramps are continuous. The firmware's begin to slow down a step or two late, end above their last speed, and the
timer's intervals are cut to whole ticks: where blocks have a dozen steps that makes up to 4 %, in prints 1 %.
"""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from trunnion_core.profile import MachineProfile, load_profile
from trunnion_sim.firmware.machine import SoftwareMachine
from trunnion_sim.judge import context_of

SPEED = {"X": 200.0, "Y": 200.0, "Z": 40.0, "A": 180.0, "B": 180.0}
ACCELERATION = {"X": 2000.0, "Y": 2000.0, "Z": 500.0, "A": 1800.0, "B": 1800.0}
CORNER = {"X": 8.0, "Y": 8.0, "Z": 0.4, "A": 8.0, "B": 8.0}
STEPS = {"X": 80.0, "Y": 80.0, "Z": 400.0, "A": 44.4444, "B": 44.4444}


def machine_of(deviation: float | None) -> MachineProfile:
    """The cradle with the figures that the oracle was given, whatever its profile says."""
    profile = load_profile("generic_ab_cradle")
    joints = []
    for joint in profile.joints:
        unit = joint.shown(1.0)
        letter = joint.letter
        joints.append(
            dataclasses.replace(
                joint,
                speed=SPEED[letter] / unit,
                acceleration=ACCELERATION[letter] / unit,
                corner_speed=CORNER[letter] / unit,
                steps_per_unit=STEPS[letter] * unit,
            )
        )
    return dataclasses.replace(
        profile,
        joints=tuple(joints),
        extruder=profile.extruder.model_copy(
            update={"steps_per_mm": 93.0, "speed": 60.0, "acceleration": 3000.0, "corner_speed": 10.0}
        ),
        planner=profile.planner.model_copy(
            update={
                "blocks": 16,
                "junction_deviation": deviation,
                "acceleration": 1500.0,
                "travel_acceleration": 1800.0,
            }
        ),
    )


def bowl() -> list[str]:
    """A spiral up a bowl in pieces of 0.2 mm."""
    return spiral(0.2, 3600, turning=False)


def tilted_bowl() -> list[str]:
    """The same with the table leaning along."""
    return spiral(0.2, 2400, turning=True)


def spiral(piece: float, feed: int, turning: bool) -> list[str]:
    lines = ["G90", "M83", "G92 E0", f"G1 X5 Y0 Z5 F{feed}"]
    t = 0.0
    for _ in range(700):
        t += piece / (5 + 0.3 * t)
        r = 5 + 0.3 * t
        x, y = r * math.cos(t), r * math.sin(t)
        turn = f" A{2 * y:.4f} B{2 * x:.4f}" if turning else ""
        lines.append(f"G1 X{x:.4f} Y{y:.4f} Z{5 + 0.01 * r * r:.4f}{turn} E{0.04 * piece:.5f}")
    return [*lines, "M400"]


def turns() -> list[str]:
    """Only rotaries move: F is in degrees."""
    feeds = (600, 3600, 9000)
    return [f"G1 A{40 * math.sin(i):.3f} B{35 * math.cos(1.7 * i):.3f} F{feeds[i % 3]}" for i in range(40)] + ["M400"]


def jumps() -> list[str]:
    """Travels each of which is waited for."""
    lines = []
    for i in range(30):
        lines += [f"G0 X{40 * math.sin(i):.3f} Y{35 * math.cos(1.7 * i):.3f} F9000", "M400"]
    return lines


def teeth() -> list[str]:
    """Zigzags of a millimetre at changing F."""
    lines = ["M83"]
    lines += [f"G1 X{0.5 * i:.3f} Y{(i % 2) * 0.8:.3f} E0.04 F{3600 if i % 7 == 0 else 1200}" for i in range(200)]
    return [*lines, "M400"]


def crumbs() -> list[str]:
    """A straight line in pieces of four steps, of which two make one block."""
    return [f"G1 X{0.05 * i - 40:.4f} F6000" for i in range(1, 1200)] + ["M400"]


def turning_travels() -> list[str]:
    """Travels with X and A together, which junction deviation takes for straighter than they are."""
    lines = [f"G0 X{8 * math.sin(i):.3f} Y{8 * math.cos(i):.3f} A{6 * math.sin(2.1 * i):.3f} F4800" for i in range(80)]
    return [*lines, "M400"]


def retractions() -> list[str]:
    """Lines, retracted travels and hops, as desktop slicers write them."""
    lines = ["M83"]
    for i in range(40):
        y = 0.4 * i
        lines += [f"G1 X{20 * ((i + 1) % 2)} Y{y:.2f} E0.7 F2400", "G1 E-0.8 F2100", "G0 Z0.4 F1200"]
        lines += [f"G0 X{7 * math.sin(i):.3f} Y{y + 0.4:.2f} F9000", "G0 Z0 F1200", "G1 E0.8 F2100"]
    return [*lines, "M400"]


Program = Callable[[], list[str]]
FIGURES: list[tuple[Program, float | None, float]] = [
    (bowl, None, 4.297),
    (bowl, 0.02, 2.642),
    (tilted_bowl, None, 4.538),
    (tilted_bowl, 0.02, 3.868),
    (turns, None, 69.463),
    (turns, 0.02, 69.399),
    (jumps, None, 14.089),
    (jumps, 0.02, 14.089),
    (teeth, None, 9.625),
    (teeth, 0.02, 10.076),
    (crumbs, None, 1.405),
    (crumbs, 0.02, 1.408),
    (turning_travels, None, 10.617),
    (turning_travels, 0.02, 10.130),
    (retractions, None, 24.263),
    (retractions, 0.02, 23.899),
]
"""Program, junction deviation in mm (None: classic jerk), and the oracle's seconds."""


@pytest.mark.parametrize(("program", "deviation", "seconds"), FIGURES)
def test_the_machine_takes_the_time_of_the_real_firmware(
    program: Program, deviation: float | None, seconds: float
) -> None:
    machine = SoftwareMachine(machine_of(deviation), speed=None)
    machine.take()
    for line in ["M302 P1", *program()]:
        machine.receive(line.encode() + b"\n")
        while b"ok" not in machine.advance(0.0):
            pass
    machine.finish()
    assert machine.now == pytest.approx(seconds, rel=0.002)


@pytest.mark.parametrize(("program", "deviation", "seconds"), FIGURES)
def test_the_judge_takes_the_time_of_the_real_firmware(
    tmp_path: Path, program: Program, deviation: float | None, seconds: float
) -> None:
    file = tmp_path / "program.gcode"
    file.write_text("\n".join(["M302 P1", *program()]) + "\n")
    assert context_of(file, machine_of(deviation)).replay.time == pytest.approx(seconds, rel=0.04)


@pytest.mark.parametrize(
    ("program", "baud", "seconds"),
    [
        (bowl, 115200, 4.327),
        (bowl, 57600, 5.667),
        (crumbs, 57600, 5.771),
        (tilted_bowl, 38400, 11.755),
    ],
)
def test_a_starved_machine_slows_down_as_the_real_firmware_does(program: Program, baud: int, seconds: float) -> None:
    """Lines arrive no faster than the wire carries them with number and checksum; four are under way at most."""
    machine = SoftwareMachine(machine_of(None))
    machine.take()
    arrival = 0.0
    answered = 0
    for number, line in enumerate(["M302 P1", *program()], 1):
        arrival += (len(line) + len(f"N{number} *") + 4) * 10 / baud
        answered += machine.run_until(max(arrival, machine.now)).count(b"ok")
        while number - answered > 4:
            answered += machine.run_until(machine.next_event).count(b"ok")
        machine.receive(line.encode() + b"\n")
    machine.finish()
    assert machine.now == pytest.approx(seconds, rel=0.002)
