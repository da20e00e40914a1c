r"""When the steps of a block fall: Marlin's trapezoid in whole steps, and the timer interrupt that walks along it.

         nominal  ______________
                 /              \        The rate is set anew at every step, from the time spent ramping so far. A step
       initial  /                \       is made at the rate of its beginning: ramps up lag behind the ideal by some
               /                  \ final steps, ramps down run ahead, and end above `final`.

`calculate_trapezoid_for_block` of `planner.cpp` and `block_phase_isr` of `stepper.cpp`, Marlin 2.1.2.5, in the integers
of 32-bit boards; one step an interrupt, no S-curve. A run costs some nanoseconds for every step of a ramp.
"""

import math

from numba import njit

from trunnion_core.arrays import FloatArray

TIMER_RATE = 2_000_000
"""Ticks/s of the step timer (STEPPER_TIMER_RATE of most boards)."""
SLOWEST = 120.0
"""Steps/s: MINIMAL_STEP_RATE, at which every move from rest begins."""
NEVER = 1 << 62
"""Ticks later than any block ends."""

EVENTS, NOMINAL, INITIAL, FINAL, ACCELERATION, ACCELERATE_UNTIL, DECELERATE_AFTER, PLACES = range(8)
"""Places in a trapezoid: steps, steps/s, steps/s²."""


@njit(cache=True)
def shape(
    trapezoid: FloatArray, events: float, nominal: float, acceleration: float, entry: float, leave: float
) -> None:
    """Write to `trapezoid` (PLACES,) where a block ramps; `entry` and `leave` are shares of `nominal` steps/s."""
    initial = max(math.ceil(nominal * entry), SLOWEST)
    final = max(math.ceil(nominal * leave), SLOWEST)
    exact_up = (nominal * nominal - initial * initial) / (2.0 * acceleration)
    exact_down = (nominal * nominal - final * final) / (2.0 * acceleration)
    up, down = max(math.ceil(exact_up), 0.0), max(math.floor(exact_down), 0.0)
    if up + down > events:
        up = min(max(math.ceil((events + exact_up - exact_down) * 0.5), 0.0), events)
        down = events - up
    trapezoid[EVENTS] = events
    trapezoid[NOMINAL] = nominal
    trapezoid[INITIAL] = initial
    trapezoid[FINAL] = final
    trapezoid[ACCELERATION] = acceleration
    trapezoid[ACCELERATE_UNTIL] = up
    trapezoid[DECELERATE_AFTER] = events - down


@njit(cache=True)
def run(trapezoid: FloatArray, most: int) -> tuple[int, int]:
    """Ticks that a block takes and the steps it makes; what is done by tick `most` where that comes first."""
    events = int(trapezoid[EVENTS])
    nominal, initial, final = int(trapezoid[NOMINAL]), int(trapezoid[INITIAL]), int(trapezoid[FINAL])
    slope = int(trapezoid[ACCELERATION] * (16777216.0 / TIMER_RATE))
    until, after = int(trapezoid[ACCELERATE_UNTIL]), int(trapezoid[DECELERATE_AFTER])
    rate = initial
    ticks = TIMER_RATE // initial
    done = 1
    if ticks > most:
        return most, 0
    while done <= until and done < events:
        rate = min((ticks * slope >> 24) + initial, nominal)
        ticks += TIMER_RATE // rate
        if ticks > most:
            return most, done
        done += 1
    cruising = min(after + 1, events) - done
    if cruising > 0:
        each = TIMER_RATE // nominal
        if ticks + each * cruising > most:
            return most, done + (most - ticks) // each
        ticks += each * cruising
        done += cruising
    falling = 0
    while done < events:
        interval = TIMER_RATE // max(rate - (falling * slope >> 24), final)
        ticks += interval
        falling += interval
        if ticks > most:
            return most, done
        done += 1
    return ticks, events
