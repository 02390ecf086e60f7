"""The bench's own uncertainty against its parts simulated one by one."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

from rverror import ARCSEC
from rverror.runs import bench_uncertainty

R = 121


def test_parts_simulated_one_by_one_scatter_as_said() -> None:
    """Readings drawn as the parts of a bench make them: encoders within limits, a tilted joint, counts."""
    rng = np.random.default_rng(5)
    n, theta = 400_000, rng.uniform(0, 2 * math.pi, 400_000)
    tilt = 0.1 / 20
    joint = np.arctan2(np.sin(theta), np.cos(theta) * math.cos(tilt)) - theta  # a universal joint's own equation
    joint = np.angle(np.exp(1j * joint))
    out_quantum, in_quantum = 2 * math.pi / 180_000, 2 * math.pi / 4096
    true = rng.uniform(0, 1, n)
    counted = np.round(true / out_quantum) * out_quantum - true
    fed = (np.round(R * true / in_quantum) * in_quantum - R * true) / R
    reading = rng.uniform(-1.24, 1.24, n) * ARCSEC + rng.uniform(-9, 9, n) * ARCSEC / R + joint + counted - fed
    found = bench_uncertainty(
        R,
        output_encoder="1.24 arcsec",
        input_encoder="9 arcsec",
        output_counts=180_000,
        input_counts=4096,
        coupling_runout="0.1 mm",
        coupling_radius="20 mm",
    )
    assert found.of("reading") / 2 == pytest.approx(float(reading.std()), rel=0.01)
    inside = np.abs(reading - reading.mean()) < found.of("reading")
    assert inside.mean() == pytest.approx(0.95, abs=0.02)


def test_source_004s_bench() -> None:
    """Its better encoder stands at the input, where a 121st of its error counts."""
    as_printed = bench_uncertainty(R, output_encoder="1.24 arcsec", input_encoder="0.39 arcsec")
    exchanged = bench_uncertainty(R, output_encoder="0.39 arcsec", input_encoder="1.24 arcsec")
    assert as_printed.of("reading") / ARCSEC == pytest.approx(2 * 1.24 / math.sqrt(3), rel=1e-4)
    assert as_printed.of("peak_to_peak") / ARCSEC == pytest.approx(4 * 1.24 / math.sqrt(3), rel=1e-4)
    assert as_printed.of("reading") / exchanged.of("reading") == pytest.approx(1.24 / 0.39, rel=1e-3)
    assert [one.name for one in as_printed.parts] == ["output encoder", "input encoder"]
    tilted = bench_uncertainty(R, output_encoder="1.24 arcsec", coupling_runout="0.1 mm", coupling_radius="20 mm")
    assert tilted.parts[0].name == "coupling"
    assert tilted.parts[0].limit / ARCSEC == pytest.approx(1.29, abs=0.005)


# --- figures of a whole waveform, against simulated encoders ----------------------------------------------------------

N = 1024
THETA = 2 * math.pi * np.arange(N) / N
CASES = 500
#: Errors of gear trains: one lobe, many lobes alike, an ordinary one, none.  In the first an encoder's order 1 stands
#: at both extremes with opposite signs, in the second every lobe waits for it.
TRUE = {
    "order 1": 20 * np.cos(THETA),
    "order 40": 10 * np.cos(40 * THETA),
    "several": 6 * np.cos(40 * THETA) + 5 * np.cos(39 * THETA + 1) + 4 * np.cos(78 * THETA) + 3 * np.cos(2 * THETA),
    "none": 0 * THETA,
}
ENCODERS = {"output_encoder": "1.24 arcsec", "input_encoder": "45 arcsec", "coupling_radius": "20 mm"}


def peak_to_peak(values: np.ndarray) -> np.ndarray:
    return np.ptp(values, axis=-1)


def rms(values: np.ndarray) -> np.ndarray:
    return values.std(axis=-1)


def amplitude(values: np.ndarray, order: int) -> np.ndarray:
    return 2 * np.abs((values * np.exp(-1j * order * THETA)).mean(axis=-1))


@functools.cache
def simulated_readings(runout: float) -> np.ndarray:
    """Errors of encoders and a tilted coupling, arcsec, shape (cases, N): sizes even up to the limit, any phase."""
    rng = np.random.default_rng(17)

    def encoder(limit: float, order: int) -> np.ndarray:
        """A curve of a shaft's first orders, the first ones the largest, that reaches a share of the limit."""
        rows = sum(
            rng.normal(size=(CASES, 1)) / k * np.cos(k * order * THETA + rng.uniform(0, 2 * math.pi, (CASES, 1)))
            for k in (1, 2, 3)
        )
        rows /= np.abs(rows).max(axis=-1, keepdims=True)
        return np.asarray(limit * rng.uniform(0, 1, (CASES, 1)) * rows)

    tilt = runout / 20 * np.sqrt(rng.uniform(0, 1, (CASES, 1)))
    turned = THETA + rng.uniform(0, 2 * math.pi, (CASES, 1))
    joint = np.angle(np.exp(1j * (np.arctan2(np.sin(turned), np.cos(turned) * np.cos(tilt)) - turned)))
    return np.asarray(encoder(1.24, 1) - encoder(45 / R, R) + joint / ARCSEC)


@pytest.mark.parametrize("runout", [0.0, 0.1])
@pytest.mark.parametrize("true", TRUE)
def test_intervals_hold_95_percent_of_simulated_encoders(true: str, runout: float) -> None:
    found = bench_uncertainty(R, coupling_runout=runout, **ENCODERS)  # type: ignore[arg-type]
    errors, gears = simulated_readings(runout), TRUE[true]
    figures = {
        "peak-to-peak": (peak_to_peak, found.of("peak_to_peak")),
        "rms": (rms, found.of("rms")),
        **{f"order {h}": ((lambda v, h=h: amplitude(v, h)), found.of_order(h)) for h in (1, 2, 40, R)},
    }
    for name, (figure, half) in figures.items():
        off = np.abs(figure(gears + errors) - figure(gears))
        assert np.mean(off <= half / ARCSEC + 1e-9) >= 0.95, name
    if true == "order 40" and not runout:  # every lobe waits for the encoder: not a difference of two free readings
        off = np.abs(peak_to_peak(gears + errors) - peak_to_peak(gears))
        assert np.mean(off <= math.sqrt(2) * found.of("reading") / ARCSEC) < 0.95


def test_the_most_that_a_part_can_do_is_done_by_a_curve() -> None:
    """A square wave within the limits and a wave of a tilted joint reach each figure's limit, none is above it."""
    found = bench_uncertainty(R, output_encoder="2 arcsec")
    square = 2 * np.sign(np.cos(THETA + 1e-3))
    assert peak_to_peak(2 * square) - peak_to_peak(square) == found.budget("peak_to_peak")[0].limit / ARCSEC
    assert rms(2 * square) - rms(square) == pytest.approx(found.budget("rms")[0].limit / ARCSEC, rel=1e-5)
    # an even share of a step more or less: the square's edges fall between samples
    assert amplitude(square, 1) == pytest.approx(found.of_order(1) / ARCSEC * math.sqrt(3) / 2, rel=1e-5)
    tilted = bench_uncertainty(R, coupling_runout="0.1 mm", coupling_radius="20 mm")
    joint = 0.1**2 / 20**2 / 4 * np.cos(2 * THETA)
    for figure, half in (
        (peak_to_peak, tilted.of("peak_to_peak")),
        (rms, tilted.of("rms")),
        (lambda v: amplitude(v, 2), tilted.of_order(2)),
    ):
        assert figure(joint) == pytest.approx(half / math.sqrt(2), rel=1e-5)  # an arcsine's divisor, and k = 2
    assert tilted.of_order(1) == tilted.of_order(R) == 0


def test_a_shafts_reading_repeats_with_that_shaft() -> None:
    """Orders of the output's encoder are whole, those of the input's whole multiples of the ratio."""
    for ratio in (R, -73.857):
        fed = bench_uncertainty(ratio, input_encoder="1 deg")
        read = bench_uncertainty(ratio, output_encoder="1 deg")
        for order in (1.0, 2.0, 11.3, 64.5, abs(ratio), 2 * abs(ratio)):
            assert (fed.of_order(order) > 0) == (order >= abs(ratio))
            assert (read.of_order(order) > 0) == (abs(order - round(order)) < 0.05)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"ratio": 0.0}, "ratio = 0: must be"),
        ({"output_encoder": -1e-6}, "output_encoder = -0.206265 arcsec: must be 0 or more"),
        ({"output_counts": 0}, "output_counts = 0: must be 1 or more"),
        ({"coupling_runout": 0.1}, "coupling_runout has no coupling_radius"),
        ({"coupling_runout": 0.1, "coupling_radius": 0.0}, "coupling_radius = 0 mm: must be above 0"),
    ],
)
def test_what_is_no_bench_is_refused(given: dict[str, float], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        bench_uncertainty(**({"ratio": 121.0} | given))  # type: ignore[arg-type]
