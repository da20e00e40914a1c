"""LinuxCNC with table kinematics (`trtfuncs.c`): as linuxcnc, but words are the tip over the part."""

import dataclasses

from trunnion_sim.firmwares import linuxcnc

RULES = dataclasses.replace(linuxcnc.RULES, name="linuxcnc_tcp", tip_words="always")
