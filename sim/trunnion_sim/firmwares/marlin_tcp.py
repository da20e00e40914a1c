"""Marlin's five-axis fork (DerAndere1/Marlin): Marlin, and with G43.4 words are the tip and F is its speed."""

import dataclasses

from trunnion_sim.firmwares import marlin

RULES = dataclasses.replace(
    marlin.RULES,
    name="marlin_tcp",
    commands=marlin.RULES.commands | {("G", 430), ("G", 434), ("G", 490)},
    tip_words="G43.4",
)
