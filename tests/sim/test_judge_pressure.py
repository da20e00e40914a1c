"""What leaves the nozzle: closed form against small steps, what is kept, which K counts, and what the check says."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trunnion_core.profile import load_profile
from trunnion_sim import pressure_kernel as kernel
from trunnion_sim.judge import context_of, judge


def rows(seed: int, n: int = 12) -> dict[str, np.ndarray]:
    """Trapezoids one after the other, with rests, drawing back, and the firmware's advance in some."""
    random = np.random.default_rng(seed)
    entry, leave = random.uniform(0, 20, n), random.uniform(0, 20, n)
    cruise = np.maximum(entry, leave) + random.choice([0.0, 15.0], n)
    acceleration = random.uniform(300, 2000, n)
    flat = random.choice([0.0, 0.02], n)
    duration = (2 * cruise - entry - leave) / acceleration + flat
    rest = random.choice([0.0, 0.0, 0.05], n)
    return {
        "per_length": random.choice([0.05, 0.05, -0.03, 0.0], n),
        "entry": entry,
        "cruise": cruise,
        "leave": leave,
        "acceleration": acceleration,
        "begin": np.cumsum(duration + rest) - duration,
        "duration": duration,
        "lag": np.full(n, random.uniform(0.01, 0.2)),
        "ahead": random.choice([0.0, 0.06], n),
    }


def in_small_steps(law: dict[str, np.ndarray], between: int, steps: int = 4000) -> np.ndarray:
    """(n,) mm that leave on every row: x pushed and let go, a step at a time."""
    excess = own = 0.0
    end = law["begin"][0]
    out = np.zeros(len(law["begin"]))
    for i in range(len(out)):
        v0, v, v1, a = (law[name][i] for name in ("entry", "cruise", "leave", "acceleration"))
        r, lag, k = law["per_length"][i], law["lag"][i], law["ahead"][i]
        up, down = (v - v0) / a, (v - v1) / a
        phases = [(law["begin"][i] - end, 0.0, 0.0, 0.0), (up, v0, a, 1.0)]
        phases += [(law["duration"][i] - up - down, v, 0.0, 1.0), (down, v, -a, 1.0)]
        end = law["begin"][i] + law["duration"][i]
        for place, (lasts, speed, change, counts) in enumerate(phases):
            if place == 1:
                if k > 0:
                    excess += 0.0 if between == kernel.RAMPS else k * r * v0 - own
                    own = k * r * v1
                elif between == kernel.AT_ONCE:
                    excess, own = excess - own, 0.0
            dt = lasts / steps
            for step in range(steps):
                pushed = counts * r * (speed + change * (step + 0.5) * dt + k * change) * dt
                flows = max(excess + 0.5 * pushed, 0.0) / lag * dt
                excess += pushed - flows
                out[i] += counts * flows
    return out


@pytest.mark.parametrize("between", [kernel.AT_ONCE, kernel.HELD, kernel.RAMPS])
@pytest.mark.parametrize("seed", [1, 2])
def test_closed_form_and_small_steps_agree(seed: int, between: int) -> None:
    law = rows(seed)
    phases, _ = kernel.run(**law, between=between)
    np.testing.assert_allclose(phases.sum(axis=1), in_small_steps(law, between), atol=2e-5)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), between=st.integers(0, 2))
def test_flow_never_runs_back_and_adds_up(seed: int, between: int) -> None:
    law = rows(seed, 8)
    phases, before = kernel.run(**law, between=between)
    assert (phases >= -1e-9).all()
    for i in range(len(before)):
        times = law["begin"][i] + (np.arange(4000) + 0.5) / 4000 * law["duration"][i]
        flow = kernel.flow_at(times, np.full(4000, i), **law, before=before)
        assert (flow >= 0).all()
        assert flow.mean() * law["duration"][i] == pytest.approx(phases[i].sum(), abs=1e-5)


def test_at_a_steady_speed_flow_follows_exponentially() -> None:
    one = {name: np.array([1.0]) for name in ("entry", "cruise", "leave", "acceleration", "duration")}
    law = {"per_length": np.array([2.0]), **one, "begin": np.zeros(1), "lag": np.array([0.1]), "ahead": np.zeros(1)}
    phases, before = kernel.run(**law, between=kernel.AT_ONCE)
    assert phases.sum() == pytest.approx(2.0 - 0.2 * (1 - np.exp(-10)), abs=1e-12)
    flow = kernel.flow_at(np.array([0.1, 1.2]), np.zeros(2, np.int64), **law, before=before)
    np.testing.assert_allclose(flow, [2 * (1 - np.exp(-1)), 2 * (1 - np.exp(-10)) * np.exp(-2)], rtol=1e-9)


def test_a_retraction_stops_the_flow_and_its_undoing_brings_it_back() -> None:
    law = {
        "per_length": np.array([0.05, -1.0, 0.0, 1.0, 0.05]),
        "entry": np.array([20.0, 30.0, 50.0, 30.0, 20.0]),
        "cruise": np.array([20.0, 30.0, 50.0, 30.0, 20.0]),
        "leave": np.array([20.0, 30.0, 50.0, 30.0, 20.0]),
        "acceleration": np.ones(5),
        "duration": np.array([1.0, 0.03, 0.5, 0.03, 1.0]),
        "lag": np.full(5, 0.05),
        "ahead": np.zeros(5),
    }
    law["begin"] = np.cumsum(law["duration"]) - law["duration"]
    phases, before = kernel.run(**law, between=kernel.AT_ONCE)
    laid = phases.sum(axis=1)
    assert laid[2] == 0.0
    assert laid[3] < 1e-3
    assert 0 < before[4] <= before[1] + 1e-12
    # the excess at the first bead's end comes out in the second, all but what left while it was drawn back
    assert laid[[0, 1, 3, 4]].sum() == pytest.approx(2.0 - 0.05, abs=1e-6)


LINE = ["G21", "G90", "M83", "G28", "G1 X0 Y0 Z0.3 F6000", ";WIDTH:0.4", ";HEIGHT:0.3", ";ROLE:solid_infill"]
PER_MM = (0.1 * 0.3 + np.pi / 4 * 0.09) / (np.pi / 4 * 1.75**2)
LINE += [f"G1 X{20 * (i % 2 == 0):d} Y{0.35 * i:.2f} E{20 * PER_MM:.5f} F2400" for i in range(4)]


def judged(folder: Path, head: list[str], firmware: str = "marlin") -> tuple[dict[str, int], np.ndarray, np.ndarray]:
    """Counts of findings, mm that leave the nozzle and mm that are fed, of lines with sharp turns."""
    file = folder / "line.gcode"
    file.write_text("\n".join([*head, *LINE]) + "\n")
    profile = dataclasses.replace(load_profile("generic_ab_cradle"), firmware=firmware)
    context = context_of(file, profile)
    return judge(file, profile).counts, context.laid, context.motion.filament


def test_without_a_word_about_it_programs_are_taken_at_their_words(tmp_path: Path) -> None:
    counts, laid, fed = judged(tmp_path, [])
    np.testing.assert_array_equal(laid, fed)
    assert not {"flow-off", "flow-wrong"} & set(counts)


@pytest.mark.parametrize(
    ("firmware", "command"),
    [("marlin", "M900 K0.06"), ("reprapfirmware", "M572 D0 S0.06"), ("klipper", "SET_PRESSURE_ADVANCE ADVANCE=0.06")],
)
def test_the_firmwares_own_advance_makes_up_for_the_lag(firmware: str, command: str, tmp_path: Path) -> None:
    told = "; plastic advance [s] = 0.06"
    counts, laid, fed = judged(tmp_path, [told, command], firmware)
    np.testing.assert_allclose(laid, fed, rtol=2e-3)
    assert not {"flow-off", "flow-wrong", "unknown-command"} & set(counts)
    counts, _, _ = judged(tmp_path, [told], firmware)
    assert {"flow-off", "flow-wrong"} & set(counts)
    counts, _, _ = judged(tmp_path, ["; plastic advance [s] = 0.03", command], firmware)
    assert {"flow-off", "flow-wrong"} & set(counts)


def test_a_commented_command_is_none(tmp_path: Path) -> None:
    _, laid, fed = judged(tmp_path, [";SET_PRESSURE_ADVANCE ADVANCE=0.06"], "klipper")
    np.testing.assert_array_equal(laid, fed)


def test_other_names_are_unknown_commands(tmp_path: Path) -> None:
    counts, _, _ = judged(tmp_path, ["SET_PRESSURE_ADVANCED ADVANCE=0.06"], "klipper")
    assert counts["unknown-command"] == 1
