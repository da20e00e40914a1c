"""How firmwares measure the length of a move, over which they read F."""

import numpy as np

from trunnion_core.arrays import FloatArray


def linear_first(linear: FloatArray, rotary: FloatArray, filament: FloatArray, threshold: float = 0.0) -> FloatArray:
    """NIST RS274NGC section 2.1.2.5 rule A, as printer firmwares extend it: the first of these that is not zero.

    The length over the linear axes, if it is above `threshold` mm; the angle over the rotary axes in degrees; the
    length of filament.
    """
    straight = np.linalg.norm(linear, axis=1)
    turned = np.linalg.norm(rotary, axis=1)
    without_linear = np.where(turned > 0, turned, np.abs(filament))
    return np.asarray(np.where(straight > threshold, straight, without_linear))


def linear_then_filament(linear: FloatArray, rotary: FloatArray, filament: FloatArray) -> FloatArray:
    """LinuxCNC's order, where the filament is a U axis: X, Y and Z, else U, V and W, else the angles in degrees.

    LinuxCNC `src/emc/rs274ngc/interp_find.cc`, find_straight_length.
    """
    straight = np.linalg.norm(linear, axis=1)
    fed = np.abs(filament)
    without_linear = np.where(fed > 0, fed, np.linalg.norm(rotary, axis=1))
    return np.asarray(np.where(straight > 0, straight, without_linear))


def all_axes(linear: FloatArray, rotary: FloatArray, filament: FloatArray) -> FloatArray:
    """The length over every axis, millimetres and degrees mixed, the filament being one of them."""
    return np.asarray(np.linalg.norm(np.column_stack([linear, rotary, filament]), axis=1))
