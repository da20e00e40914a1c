"""Heaters: curves against closed forms, and each protection in its own words."""

import math

import pytest

from trunnion_core.profile import MachineProfile, load_profile
from trunnion_sim.firmware.faults import parse_fault
from trunnion_sim.firmware.heat import Heater, hotend
from trunnion_sim.firmware.machine import SoftwareMachine


@pytest.fixture(scope="module")
def profile() -> MachineProfile:
    return load_profile("generic_ab_cradle")


@pytest.mark.parametrize("tick", [0.02, 0.1, 0.7])
def test_full_power_follows_the_exponential_however_time_is_cut(tick: float) -> None:
    heater = Heater(hotend(2000.0), 21.0, 0)
    heater.stuck_on = True
    t = 0.0
    while t < 60.0:
        heater.tick(t, tick)
        t += tick
    model = heater.model
    assert heater.body == pytest.approx(21.0 + model.rise * (1 - math.exp(-t / model.time_constant)), abs=1e-9)
    assert heater.reading < heater.body


def test_control_settles_on_the_target_with_little_overshoot() -> None:
    heater = Heater(hotend(285.0), 21.0, 0)
    heater.set_target(210.0, 0.0)
    seen = []
    for i in range(3000):
        assert heater.tick(0.1 * i, 0.1) is None
        seen.append(heater.reading)
    assert max(seen) < 213.0
    assert all(abs(reading - 210.0) < 1.0 for reading in seen[-500:])
    assert len(set(seen[-500:])) > 100


def heated(profile: MachineProfile, *faults: str, lines: str = "M104 S200\n", seconds: float = 400.0) -> str:
    machine = SoftwareMachine(profile, faults=[parse_fault(spec) for spec in faults])
    machine.receive(lines.encode())
    return machine.run_until(seconds).decode()


HALT = "Error:Printer halted. kill() called!\n//action:poweroff\n"


@pytest.mark.parametrize(
    ("fault", "lines", "text"),
    [
        ("runaway:time=1", "M104 S200\n", "Heating failed, system stopped! Heater_ID: E0\n\necho:Heating Failed\n"),
        ("runaway:time=200", "M104 S200\n", "Thermal Runaway, system stopped! Heater_ID: E0\n\necho:THERMAL RUNAWAY\n"),
        (
            "sensor-open:time=5",
            "M104 S200\n",
            "MINTEMP triggered, system stopped! Heater_ID: E0\n\necho:Err: MINTEMP\n",
        ),
        ("sensor-short:time=5", "", "MAXTEMP triggered, system stopped! Heater_ID: E0\n\necho:Err: MAXTEMP\n"),
        ("maxtemp:time=5", "", "MAXTEMP triggered, system stopped! Heater_ID: E0\n\necho:Err: MAXTEMP\n"),
        ("runaway:heater=bed,time=200", "M140 S60\n", "Thermal Runaway, system stopped! Heater_ID: bed\necho:"),
        ("sensor-open:heater=bed,time=5", "M140 S60\n", "MINTEMP triggered, system stopped! Heater_ID: bed\necho:"),
    ],
)
def test_protections_halt_in_their_own_words(profile: MachineProfile, fault: str, lines: str, text: str) -> None:
    said = heated(profile, fault, lines=lines)
    assert f"Error:{text}" in said
    assert said.endswith(HALT)


def test_a_sound_heater_never_halts(profile: MachineProfile) -> None:
    lines = "M104 S200\nM140 S60\nM155 S10\nG4 S500\n"
    said = heated(profile, lines=lines, seconds=600.0)
    assert "Error" not in said
    machine = SoftwareMachine(profile)
    machine.receive(b"M104 S250\n")
    machine.run_until(200.0)
    machine.receive(b"M104 S150\n")
    assert b"Error" not in machine.run_until(800.0)


def test_an_interrupted_sensor_is_seen_though_the_heater_is_off(profile: MachineProfile) -> None:
    machine = SoftwareMachine(profile, faults=[parse_fault("sensor-open:time=5")])
    machine.run_until(6.0)
    machine.receive(b"M105\n")
    assert machine.run_until(7.0).startswith(b"ok T:-14.91 /0.00")


def test_runaway_waits_for_its_window(profile: MachineProfile) -> None:
    machine = SoftwareMachine(profile, faults=[parse_fault("runaway:time=200")])
    machine.receive(b"M104 S200\n")
    machine.run_until(200.0)
    while not machine.halted and machine.now < 400.0:
        machine.run_until(machine.now + 0.5)
    fall = -machine.heaters[0].model.time_constant * math.log(1 - 4.0 / (200.0 - 21.0))
    assert machine.now == pytest.approx(200.0 + fall + 40.0, abs=3.0)


def test_waiting_for_heat_reports_every_second_and_ends_after_resting(profile: MachineProfile) -> None:
    machine = SoftwareMachine(profile)
    machine.take()
    machine.receive(b"M109 S200\n")
    said = machine.run_until(120.0).decode().splitlines()
    assert said[-1] == "ok"
    lines = [line for line in said if line.startswith(" T:")]
    assert lines[0].endswith("W:?")
    assert lines[-1].endswith("W:0")
    assert any("busy: processing" in line for line in said)
    assert machine.heaters[0].reading == pytest.approx(200.0, abs=2.0)


def test_waiting_ends_on_m108_and_not_when_cooling_is_needless(profile: MachineProfile) -> None:
    machine = SoftwareMachine(profile)
    machine.receive(b"M109 S200\n")
    machine.run_until(10.0)
    machine.receive(b"M108\n")
    assert machine.run_until(10.2).endswith(b"ok\nok\n")
    machine.receive(b"M109 S30\n")
    assert machine.run_until(10.3).endswith(b"ok\n")


def test_targets_are_cut_to_what_the_heater_may_reach(profile: MachineProfile) -> None:
    machine = SoftwareMachine(profile)
    machine.receive(b"M104 S9999\nM105\n")
    assert b"/285.00" in machine.run_until(0.0)


def test_as_fast_as_possible_heats_in_simulated_time(profile: MachineProfile) -> None:
    machine = SoftwareMachine(profile, speed=None)
    machine.receive(b"M190 S60\n")
    machine.finish()
    assert 60.0 < machine.now < 400.0
