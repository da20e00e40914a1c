"""LinuxCNC in joint coordinates (TCP off) with inverse time feed, the filament as a U axis.

RS274NGC knows no E word, no relative mode for one axis and no heaters: filament is absolute U from 0 (`G92 U0`), and
M100 to M199 are user-defined commands with P words, which the machine's configuration has to supply. G0 ignores F, so
travels are G1 as well. With G93 every move carries F, one over its minutes.
"""

from trunnion_core.profile import MachineProfile
from trunnion_gcode.dialect import Dialect
from trunnion_gcode.metrics import linear_then_filament
from trunnion_gcode.planner import Planner
from trunnion_gcode.stated import RELIES, said

TOLERANCE = 0.01
"""mm that corners may be rounded by."""

SLOWEST = 0.1 / 60.0
"""Units/s that G93 reads at least (`src/emc/rs274ngc/interp_inverse.cc`, inverse_time_rate_straight)."""


def axes(profile: MachineProfile) -> tuple[str, ...]:
    """The lines of the ini file: limits of every axis and its joint, and what must not limit the path besides."""
    limits = [(joint.letter, joint.shown(joint.speed), joint.shown(joint.acceleration)) for joint in profile.joints]
    limits.append(("U", profile.extruder.speed, profile.extruder.acceleration))
    fastest = sum(joint.speed**2 for joint in profile.joints if not joint.rotary) ** 0.5
    return (
        f"{RELIES} [EMCMOT] SERVO_PERIOD = 1000000",
        f"{RELIES} [TRAJ] MAX_LINEAR_VELOCITY of {said(fastest)} or more",
        *(
            f"{RELIES} [AXIS_{letter}] and its [JOINT_] MAX_VELOCITY = {said(v)} MAX_ACCELERATION = {said(a)}"
            for letter, v, a in limits
        ),
        f"{RELIES} user-defined M104, M106, M107, M109, M140 and M190 (P words), and homing before the program",
    )


def setup(profile: MachineProfile) -> tuple[str, ...]:
    """Kinematics of joints, and the axes' limits."""
    letters = "".join(letter for letter in "xyzabc" if letter.upper() in profile.letters)
    return (f"{RELIES} [KINS] KINEMATICS = trivkins coordinates={letters}u", *axes(profile))


DIALECT = Dialect(
    name="linuxcnc",
    metric=linear_then_filament,
    planner=Planner("blend", slowest=SLOWEST, tolerance=TOLERANCE),
    inverse_time=True,
    relative_extrusion=False,
    extruder="U",
    travel="G1",
    start=("G21", "G17", "G40", "G49", "G80", "G90", "G92 U0", f"G64 P{TOLERANCE}", "G93"),
    finish=("G94", "M2"),
    nozzle_temperature="M104 P%s",
    wait_nozzle="M109 P%s",
    bed_temperature="M140 P%s",
    wait_bed="M190 P%s",
    fan="M106 P%s",
    progress=None,
    checksums=False,
    shortest=2e-3,
    max_line=255,
    setup=setup,
)
