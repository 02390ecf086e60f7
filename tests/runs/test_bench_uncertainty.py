"""The bench's own uncertainty against its parts simulated one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rverror import ARCSEC, bench_uncertainty

R = 121


def test_parts_simulated_one_by_one_scatter_as_said() -> None:
    """Readings drawn as the parts of a bench make them: encoders within limits, a tilted joint, counts, noise."""
    rng = np.random.default_rng(5)
    n, theta = 400_000, rng.uniform(0, 2 * math.pi, 400_000)
    tilt = 0.1 / 20
    joint = np.arctan2(np.sin(theta), np.cos(theta) * math.cos(tilt)) - theta  # a universal joint's own equation
    joint = np.angle(np.exp(1j * joint))
    out_quantum, in_quantum = 2 * math.pi / 180_000, 2 * math.pi / 4096
    true = rng.uniform(0, 1, n)
    counted = np.round(true / out_quantum) * out_quantum - true
    fed = (np.round(R * true / in_quantum) * in_quantum - R * true) / R
    reading = (
        rng.uniform(-1.24, 1.24, n) * ARCSEC
        + rng.uniform(-9, 9, n) * ARCSEC / R
        + joint
        + counted
        - fed
        + rng.normal(0, 0.6 * ARCSEC / math.sqrt(3), n)
    )
    found = bench_uncertainty(
        R,
        output_encoder="1.24 arcsec",
        input_encoder="9 arcsec",
        output_counts=180_000,
        input_counts=4096,
        coupling_runout="0.1 mm",
        coupling_radius="20 mm",
        noise="0.6 arcsec",
        revolutions=3,
    )
    assert found.standard == pytest.approx(float(reading.std()), rel=0.01)
    inside = np.abs(reading - reading.mean()) < found.expanded
    assert inside.mean() == pytest.approx(0.95, abs=0.02)


def test_source_004s_bench() -> None:
    """Its better encoder stands at the input, where a 121st of its error counts."""
    as_printed = bench_uncertainty(R, output_encoder="1.24 arcsec", input_encoder="0.39 arcsec")
    exchanged = bench_uncertainty(R, output_encoder="0.39 arcsec", input_encoder="1.24 arcsec")
    assert as_printed.expanded / ARCSEC == pytest.approx(1.96 * 1.24 / math.sqrt(3), rel=1e-4)
    assert as_printed.expanded / exchanged.expanded == pytest.approx(1.24 / 0.39, rel=1e-3)
    assert [one.name for one in as_printed.parts] == ["output encoder", "input encoder"]
    tilted = bench_uncertainty(R, output_encoder="1.24 arcsec", coupling_runout="0.1 mm", coupling_radius="20 mm")
    assert tilted.parts[0].name == "coupling"
    assert tilted.parts[0].limit / ARCSEC == pytest.approx(1.29, abs=0.005)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"ratio": 0.0}, "ratio = 0: must be"),
        ({"output_encoder": -1e-6}, "output_encoder = -1e-06: must be 0 or more"),
        ({"output_counts": 0}, "output_counts = 0: must be 1 or more"),
        ({"coupling_runout": 0.1}, "coupling_runout has no coupling_radius"),
        ({"coupling_runout": 0.1, "coupling_radius": 0.0}, "coupling_radius = 0 mm: must be above 0"),
    ],
)
def test_what_is_no_bench_is_refused(given: dict[str, float], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        bench_uncertainty(**({"ratio": 121.0} | given))  # type: ignore[arg-type]
