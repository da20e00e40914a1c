"""Heaters: power in, temperature, and what the firmware's protections make of it.

A heater is a first-order body (closed form between ticks, so the curve does not depend on how time is cut), read by a
sensor that lags and is noisy. Protection follows Marlin 2.1 `temperature.cpp`: watch after a new target, thermal
runaway once it was reached, MINTEMP while heating, MAXTEMP always.
"""

import math
import random
from dataclasses import dataclass
from enum import Enum

TICK = 0.1
"""s between two readings of the sensors."""
OPEN_READING = -14.91
"""°C that an interrupted thermistor reads as."""
SHORT_READING = 451.0
"""°C that a shorted thermistor reads as."""


@dataclass(frozen=True)
class HeaterModel:
    """A heater's physics and the windows of its protection; °C and s."""

    name: str
    id: str
    """What the firmware calls it in errors: E0, bed."""
    rise: float
    """Steady rise over ambient at full power."""
    time_constant: float
    sensor_lag: float
    noise: float
    gain: float
    """Duty per °C of deviation."""
    maximum: float
    """Reading that kills (MAXTEMP)."""
    overshoot: float
    """How far below `maximum` targets end."""
    watch_period: float
    watch_increase: float
    runaway_period: float
    runaway_hysteresis: float
    minimum: float = 5.0
    window: float = 1.0
    hysteresis: float = 3.0
    residency: float = 10.0
    """s within `hysteresis` of the target before a wait ends."""


def hotend(limit: float) -> HeaterModel:
    """A 40 W hot end that takes targets up to `limit`."""
    return HeaterModel("T", "E0", 620.0, 155.0, 1.2, 0.05, 0.08, limit + 15.0, 15.0, 40.0, 2.0, 40.0, 4.0)


def bed(limit: float) -> HeaterModel:
    """A heated bed that takes targets up to `limit`."""
    return HeaterModel("B", "bed", 160.0, 260.0, 3.0, 0.03, 0.2, limit + 10.0, 10.0, 60.0, 2.0, 20.0, 2.0)


class HeatError(Enum):
    """What the firmware says over serial, and on its display."""

    HEATING_FAILED = ("Heating failed", "Heating Failed")
    RUNAWAY = ("Thermal Runaway", "THERMAL RUNAWAY")
    MAXTEMP = ("MAXTEMP triggered", "Err: MAXTEMP")
    MINTEMP = ("MINTEMP triggered", "Err: MINTEMP")


class Sensor(Enum):
    """State of a thermistor's wires."""

    GOOD = "good"
    OPEN = "open"
    SHORT = "short"


class Heater:
    """One heater with its sensor, its control and its guards."""

    def __init__(self, model: HeaterModel, ambient: float, seed: int) -> None:
        self.model = model
        self.ambient = ambient
        self.target = 0.0
        self.body = ambient
        """True temperature."""
        self.duty = 0.0
        self.power_cut = False
        """The cartridge has come loose: duty does nothing."""
        self.stuck_on = False
        """The switch has fused: full power whatever the duty."""
        self.sensor = Sensor.GOOD
        self._sensed = ambient
        self._random = random.Random(f"{seed} {model.name}")
        self.reading = ambient + self._random.gauss(0.0, model.noise)
        self._watch: tuple[float, float] | None = None
        self._reached = False
        self._runaway_at = math.inf

    @property
    def quiet(self) -> bool:
        """Whether nothing but noise happens: off, cool and sound."""
        return (
            not self.target
            and not self.stuck_on
            and self.sensor is not Sensor.SHORT
            and abs(self.body - self.ambient) < 0.01
            and abs(self._sensed - self.ambient) < 0.01
        )

    def set_target(self, target: float, now: float) -> None:
        """A new target, cut to what the firmware accepts."""
        model = self.model
        target = min(max(target, 0.0), model.maximum - model.overshoot)
        if target != self.target:
            self._reached = False
            self._runaway_at = math.inf
        self.target = target
        if target and self.reading < target - (model.watch_increase + model.hysteresis + 1.0):
            self._watch = (now + model.watch_period, self.reading + model.watch_increase)
        else:
            self._watch = None

    def tick(self, now: float, elapsed: float) -> HeatError | None:
        """Let `elapsed` s pass until `now`, read the sensor, steer, and guard."""
        model = self.model
        power = 1.0 if self.stuck_on else 0.0 if self.power_cut else self.duty
        steady = self.ambient + model.rise * power
        self.body = steady + (self.body - steady) * math.exp(-elapsed / model.time_constant)
        self._sensed = self.body + (self._sensed - self.body) * math.exp(-elapsed / model.sensor_lag)
        if self.sensor is Sensor.GOOD:
            self.reading = self._sensed + self._random.gauss(0.0, model.noise)
        else:
            self.reading = OPEN_READING if self.sensor is Sensor.OPEN else SHORT_READING
        if self.target:
            wanted = (self.target - self.ambient) / model.rise + model.gain * (self.target - self.reading)
            self.duty = min(max(wanted, 0.0), 1.0)
        else:
            self.duty = 0.0
        return self._guard(now)

    def _guard(self, now: float) -> HeatError | None:
        model = self.model
        if self.reading >= model.maximum:
            return HeatError.MAXTEMP
        if not self.target:
            return None
        if self.reading <= model.minimum:
            return HeatError.MINTEMP
        if self._watch is not None and now >= self._watch[0]:
            if self.reading < self._watch[1]:
                return HeatError.HEATING_FAILED
            self.set_target(self.target, now)
        if self.reading >= self.target - model.runaway_hysteresis:
            self._reached = self._reached or self.reading >= self.target
            self._runaway_at = now + model.runaway_period
        elif self._reached and now >= self._runaway_at:
            return HeatError.RUNAWAY
        return None
