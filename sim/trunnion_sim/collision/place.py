"""Where bodies are: the joint chain multiplied out for the joints that carry a body (product of exponentials)."""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from trunnion_core.arrays import FloatArray


class Chain(NamedTuple):
    """The joints of a machine, and where its part stands."""

    work_side: NDArray[np.bool_]
    """(k,) which joints carry the part."""
    rotary: NDArray[np.bool_]
    """(k,)."""
    axes: FloatArray
    """(k, 3) unit."""
    pivots: FloatArray
    """(k, 3) mm."""
    origin: FloatArray
    """(3,) mm."""


class Bodies(NamedTuple):
    """Every convex solid of a machine."""

    rows: FloatArray
    """(b, 8) of `solids`."""
    corners: FloatArray
    """(h, 3) of hulls."""
    faces: FloatArray
    """(f, 4) of hulls."""
    middles: FloatArray
    """(b, 3) mm in the body's frame: centre of a ball that holds it."""
    radii: FloatArray
    """(b,) mm of that ball."""
    turns: FloatArray
    """(b, 3, 3) machine from body, all joints at zero."""
    places: FloatArray
    """(b, 3) mm: origin of the body's frame in the machine, all joints at zero."""
    carried: NDArray[np.bool_]
    """(b, k) which joints carry the body."""
    tool: NDArray[np.bool_]
    """(b,) bodies in the tool frame, whose tip touches the bead being laid."""


@njit(cache=True)
def link(q: Any, carriers: Any, chain: Any, rotation: Any, shift: Any) -> Any:
    """Motion of what the joints `carriers` (k,) of one side carry at q: point -> rotation @ point + shift."""
    rotation[:] = 0.0
    rotation[0, 0] = rotation[1, 1] = rotation[2, 2] = 1.0
    shift[:] = 0.0
    step = np.empty((3, 3))
    product = np.empty((3, 3))
    for j in range(len(q)):
        if not carriers[j]:
            continue
        if chain.rotary[j]:
            _turn(chain.axes[j], q[j], step)
            pivot = chain.pivots[j]
            for r in range(3):
                moved = 0.0
                for c in range(3):
                    off = pivot[c] - (step[c, 0] * pivot[0] + step[c, 1] * pivot[1] + step[c, 2] * pivot[2])
                    moved += rotation[r, c] * off
                    product[r, c] = (
                        rotation[r, 0] * step[0, c] + rotation[r, 1] * step[1, c] + rotation[r, 2] * step[2, c]
                    )
                shift[r] += moved
            rotation[:] = product
        else:
            axis = chain.axes[j]
            for r in range(3):
                along = rotation[r, 0] * axis[0] + rotation[r, 1] * axis[1] + rotation[r, 2] * axis[2]
                shift[r] += q[j] * along


@njit(cache=True)
def place(q: Any, carriers: Any, b: Any, chain: Any, bodies: Any, rotation: Any, shift: Any) -> Any:
    """Machine from body b at q, as if only the joints `carriers` (k,) carried it, into rotation and shift."""
    turned, moved = np.empty((3, 3)), np.empty(3)
    link(q, carriers, chain, turned, moved)
    turn, at = bodies.turns[b], bodies.places[b]
    for r in range(3):
        shift[r] = turned[r, 0] * at[0] + turned[r, 1] * at[1] + turned[r, 2] * at[2] + moved[r]
        for c in range(3):
            rotation[r, c] = turned[r, 0] * turn[0, c] + turned[r, 1] * turn[1, c] + turned[r, 2] * turn[2, c]


@njit(cache=True)
def place_in_part(q: Any, b: Any, chain: Any, bodies: Any, rotation: Any, shift: Any) -> Any:
    """Part from body b at q, into rotation (3, 3) and shift (3,)."""
    turned, moved = np.empty((3, 3)), np.empty(3)
    work, away = np.empty((3, 3)), np.empty(3)
    place(q, bodies.carried[b], b, chain, bodies, turned, moved)
    link(q, chain.work_side, chain, work, away)
    for r in range(3):
        shift[r] = -chain.origin[r]
        for m in range(3):
            shift[r] += work[m, r] * (moved[m] - away[m])
        for c in range(3):
            rotation[r, c] = work[0, r] * turned[0, c] + work[1, r] * turned[1, c] + work[2, r] * turned[2, c]


@njit(cache=True)
def _turn(axis: Any, angle: Any, out: Any) -> Any:
    """Rodrigues' formula into out (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    t = 1.0 - c
    x, y, z = axis[0], axis[1], axis[2]
    out[0, 0], out[0, 1], out[0, 2] = t * x * x + c, t * x * y - s * z, t * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = t * x * y + s * z, t * y * y + c, t * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = t * x * z - s * y, t * y * z + s * x, t * z * z + c
