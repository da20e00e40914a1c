"""What each firmware fault does to the machine."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from trunnion_sim.firmware import planner_kernel as kernel
from trunnion_sim.firmware import replies
from trunnion_sim.firmware.faults import Fault
from trunnion_sim.firmware.heat import Heater, Sensor
from trunnion_sim.firmware.waits import Steps, Wait

if TYPE_CHECKING:
    from trunnion_sim.firmware.machine import SoftwareMachine


def strike(machine: "SoftwareMachine", fault: Fault) -> Steps | None:
    """Let the fault happen; a delay that it brings is returned, for the command that begins now to serve first."""
    return STRIKES[fault.kind](machine, fault)


def _resend_old(machine: "SoftwareMachine", fault: Fault) -> None:
    machine.say(f"Resend: {max(machine.reader.last + 1 - int(fault.number('back')), 1)}\nok\n")


def _resend_future(machine: "SoftwareMachine", fault: Fault) -> None:
    machine.say(f"Resend: {machine.reader.last + 1 + int(fault.number('ahead'))}\nok\n")


def _resend_next(machine: "SoftwareMachine", fault: Fault) -> None:
    machine.say(f"Resend: {machine.reader.last + 1}\nok\n")


def _resend_no_ok(machine: "SoftwareMachine", fault: Fault) -> None:
    machine.resend_ok_after = None


def _resend_late_ok(machine: "SoftwareMachine", fault: Fault) -> None:
    machine.resend_ok_after = fault.number("seconds")


def _resend_forever(machine: "SoftwareMachine", fault: Fault) -> None:
    machine.refuses_lines = True


def _reset(machine: "SoftwareMachine", fault: Fault) -> None:
    machine.reset(quietly=fault.kind == "reset-silent")


def _kill(machine: "SoftwareMachine", fault: Fault) -> None:
    machine.kill(None)


def _heater(machine: "SoftwareMachine", fault: Fault) -> Heater:
    machine.watch_heat()
    return machine.heaters[-1 if fault.word("heater") == "bed" else 0]


def _runaway(machine: "SoftwareMachine", fault: Fault) -> None:
    _heater(machine, fault).power_cut = True


def _maxtemp(machine: "SoftwareMachine", fault: Fault) -> None:
    _heater(machine, fault).stuck_on = True


def _sensor_open(machine: "SoftwareMachine", fault: Fault) -> None:
    _heater(machine, fault).sensor = Sensor.OPEN


def _sensor_short(machine: "SoftwareMachine", fault: Fault) -> None:
    _heater(machine, fault).sensor = Sensor.SHORT


def _unplug(machine: "SoftwareMachine", fault: Fault) -> None:
    machine.unplugged_until = machine.now + (fault.number("seconds") or math.inf)


def _slow(machine: "SoftwareMachine", fault: Fault) -> Steps:
    busy = "processing" if fault.kind == "slow-busy" else ""
    yield Wait(until=machine.now + fault.number("seconds"), busy=busy)


def _ring(machine: "SoftwareMachine", fault: Fault) -> None:
    machine.ring.size = max(int(fault.number("size")), 1)


def _steps(machine: "SoftwareMachine", fault: Fault) -> None:
    column = machine.motion.columns.get(fault.word("axis"), len(machine.motion.columns) - 1)
    machine.planner.limits[kernel.STEPS_PER_UNIT, column] *= fault.number("factor")
    machine.planner.refresh(machine.motion.joints)


def _unreachable(machine: "SoftwareMachine", fault: Fault) -> None:
    machine.dropped_moves += 1


def _action(machine: "SoftwareMachine", fault: Fault) -> None:
    machine.say(f"//action:{fault.kind}\n")


def _prompt(machine: "SoftwareMachine", fault: Fault) -> Steps:
    machine.say(replies.prompt("Check the printer", "Continue"))
    machine.waits_for_user = machine.prompt_open = True
    yield Wait(ready=lambda: not machine.waits_for_user, busy="paused for user", user=True)


STRIKES: dict[str, Callable[["SoftwareMachine", Fault], Steps | None]] = {
    "resend-old": _resend_old,
    "resend-future": _resend_future,
    "resend-next": _resend_next,
    "resend-no-ok": _resend_no_ok,
    "resend-late-ok": _resend_late_ok,
    "resend-forever": _resend_forever,
    "reset": _reset,
    "reset-silent": _reset,
    "kill": _kill,
    "runaway": _runaway,
    "maxtemp": _maxtemp,
    "sensor-open": _sensor_open,
    "sensor-short": _sensor_short,
    "unplug": _unplug,
    "slow-busy": _slow,
    "slow-silent": _slow,
    "ring": _ring,
    "steps": _steps,
    "unreachable": _unreachable,
    "pause": _action,
    "resume": _action,
    "cancel": _action,
    "prompt": _prompt,
}
