"""Sobol indices: functions whose indices are known, another library's, and tolerance stacks."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from scipy import special

import rverror
from rverror import InputError
from rverror.tolerances import sobol
from rverror.tolerances.declared import tolerance
from rverror.tolerances.sobol import SobolIndices, stack_indices
from rverror.tolerances.stacking import stack


def sobol_indices(*arguments: Any, **settings: Any) -> SobolIndices:
    """Of a function that varies."""
    (found,) = sobol.sobol_indices(*arguments, **settings)
    assert found is not None
    return found


def ishigami(uniforms: np.ndarray) -> np.ndarray:
    """Ishigami and Homma 1990, a = 7, b = 0.1."""
    x = np.pi * (2 * uniforms - 1)
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def ishigami_indices() -> tuple[np.ndarray, np.ndarray]:
    a, b = 7.0, 0.1
    alone = np.array([(1 + b * math.pi**4 / 5) ** 2 / 2, a**2 / 8, 0.0])
    together = b**2 * math.pi**8 * (1 / 18 - 1 / 50)  # of the first and the third
    variance = alone.sum() + together
    return alone / variance, (alone + together * np.array([1, 0, 1])) / variance


def rayleigh(uniforms: np.ndarray) -> np.ndarray:
    """Peak-to-peak of two vectors of one order, the second half as large."""
    normal = special.ndtri(uniforms)
    return 2 * np.hypot(normal[:, 0] + normal[:, 2] / 2, normal[:, 1] + normal[:, 3] / 2)


def rayleigh_indices() -> tuple[np.ndarray, np.ndarray]:
    """By quadrature: given one vector, the length of the sum is a Rice variable, whose mean is a Laguerre function.

    For two groups the total index of the one is what the first-order index of the other leaves.
    """
    squares = 4 * 2 * (1 + 1 / 4)
    mean = 2 * math.sqrt(1.25) * math.sqrt(math.pi / 2)
    variance = squares - mean**2

    def alone(known: float, other: float) -> float:
        length = np.linspace(0, 12 * known, 200_001)
        density = length / known**2 * np.exp(-(length**2) / (2 * known**2))
        z = length**2 / (4 * other**2)
        laguerre = (1 + 2 * z) * special.ive(0, z) + 2 * z * special.ive(1, z)
        given = 2 * other * math.sqrt(math.pi / 2) * laguerre
        return float(np.trapezoid(density * (given - mean) ** 2, length)) / variance

    first = np.array([alone(1.0, 0.5), alone(0.5, 1.0)])
    return first, 1 - first[::-1]


def additive(uniforms: np.ndarray) -> np.ndarray:
    return 1e3 + uniforms @ np.array([4.0, 3.0, 0.0, 1.0, 2.0])


CASES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], list[int], tuple[np.ndarray, np.ndarray]]] = {
    "Ishigami": (ishigami, [0, 1, 2], ishigami_indices()),
    "Rayleigh": (rayleigh, [0, 0, 1, 1], rayleigh_indices()),
    "additive": (additive, [0, 1, 2, 3, 1], (np.array([16, 13, 0, 1]) / 30,) * 2),
}


def held(found: SobolIndices, first: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Which intervals hold the true index."""
    return np.concatenate(
        [
            (found.first_low - 1e-12 <= first) & (first <= found.first_high + 1e-12),
            (found.total_low - 1e-12 <= total) & (total <= found.total_high + 1e-12),
        ]
    )


@pytest.mark.parametrize("name", CASES)
def test_known_indices(name: str) -> None:
    """Of 15 seeds' intervals at 95 %, no fewer than 85 % hold; the estimates are near."""
    function, groups, (first, total) = CASES[name]
    found = [sobol_indices(function, groups, count=1024, seed=seed) for seed in range(15)]
    assert np.mean([held(one, first, total) for one in found]) >= 0.85
    for which in ("first", "total"):  # the intervals are as wide as the estimates scatter
        scatter = np.std([getattr(one, which) for one in found], axis=0, ddof=1)
        widths = [getattr(one, f"{which}_high") - getattr(one, f"{which}_low") for one in found]
        assert (np.mean(widths, axis=0) / 2 < 3.2 * scatter + 1e-12).all()
    close = sobol_indices(function, groups, count=2**14)
    np.testing.assert_allclose(close.first, first, atol=0.015)
    np.testing.assert_allclose(close.total, total, atol=0.015)
    assert (close.first_high - close.first_low).max() < (found[0].first_high - found[0].first_low).max()


def test_rayleigh_truth_by_simulation() -> None:
    """The quadrature itself: variance of the mean over the other vector, on a plain grid of vectors."""
    rng = np.random.default_rng(0)
    first = rayleigh_indices()[0][0]
    lengths = np.sqrt(-2 * np.log((np.arange(400) + 0.5) / 400))  # strata of the first vector's length
    x, y = rng.normal(size=(2, 4000)) / 2
    means = np.array([2 * np.hypot(length + x, y).mean() for length in lengths])
    both = 2 * np.hypot(*(rng.normal(size=(2, 200_000)) * math.sqrt(1.25)))
    assert means.var() / both.var() == pytest.approx(first, abs=0.02)


def test_a_group_is_exchanged_as_a_whole() -> None:
    """A product within a group counts as its own; apart it would be an interaction."""
    function = lambda u: (u[:, 0] - 0.5) * (u[:, 2] - 0.5) * 12 + u[:, 1]  # noqa: E731
    together = sobol_indices(function, [0, 1, 0], count=2**13)
    apart = sobol_indices(function, [0, 1, 2], count=2**13)
    share = 1 / (1 + 1 / 12)
    np.testing.assert_allclose(together.first, [share, 1 - share], atol=0.03)
    np.testing.assert_allclose(together.total, [share, 1 - share], atol=0.03)
    np.testing.assert_allclose(apart.first, [0, 1 - share, 0], atol=0.05)
    np.testing.assert_allclose(apart.total, [share, 1 - share, share], atol=0.03)
    assert together.variance == pytest.approx(1 + 1 / 12, rel=0.02)


def test_against_salib() -> None:
    """The same function of the same groups, each within the two intervals together."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sample = pytest.importorskip("SALib.sample.sobol")
        analyze = pytest.importorskip("SALib.analyze.sobol")
        names = [f"u{i}" for i in range(4)]
        problem: dict[str, Any] = {"num_vars": 4, "names": names, "bounds": [[0, 1]] * 4, "groups": list("aabb")}
        for function, groups in ((rayleigh, [0, 0, 1, 1]), (ishigami, [0, 1, 2])):
            if function is ishigami:
                problem = {"num_vars": 3, "names": names[:3], "bounds": [[0, 1]] * 3}
            points = sample.sample(problem, 4096, calc_second_order=False, seed=1)
            points = np.clip(points, 1e-9, 1 - 1e-9)
            theirs = analyze.analyze(problem, function(points), calc_second_order=False, seed=1)
            ours = sobol_indices(function, groups, count=4096)
            for name, index, low, high in (
                ("S1", ours.first, ours.first_low, ours.first_high),
                ("ST", ours.total, ours.total_low, ours.total_high),
            ):
                gap = np.abs(index - theirs[name])
                assert (gap <= theirs[f"{name}_conf"] + (high - low) / 2).all()


# --- tolerance stacks -------------------------------------------------------------------------------------------------

UNIT = rverror.Model(rverror.reducer("RV-40E"))
THETA = 2 * np.pi * np.arange(256) / 256


def test_two_encoder_vectors() -> None:
    """Orders 1 of encoder, drawn as two entries of one order: the Rayleigh case through a stack."""
    pair = [tolerance("sensor.encoder_eccentricity", width) for width in ("10 arcsec", "5 arcsec")]
    found, plain = stack_indices(stack(UNIT, pair, THETA)), sobol_indices(rayleigh, [0, 0, 1, 1])
    np.testing.assert_allclose(found.first, plain.first, atol=1e-4)  # the peaks may fall between angles
    np.testing.assert_allclose(found.total, plain.total, atol=1e-4)
    assert found.first.sum() < 1 < found.total.sum()


def test_an_entry_that_only_shifts_has_no_share() -> None:
    given = stack(
        UNIT,
        [
            tolerance("coupling.carrier_bore_position", "5 um"),
            tolerance("crank.eccentricity", "5 um"),
            tolerance("sensor.encoder_eccentricity", "5 arcsec"),
        ],
        THETA,
    )
    found = stack_indices(given, count=512)
    np.testing.assert_allclose([found.first[0], found.total[0]], 0, atol=1e-9)
    assert found.total[1] > 0.1
    assert found.total[2] > 0.02


def test_what_does_not_vary_has_no_indices() -> None:
    assert sobol.sobol_indices(lambda u: np.ones(len(u)), [0, 1]) == (None,)
    shifting = [
        tolerance(key, "5 um") for key in ("involute.sun_offset", "involute.center_distance")
    ]  # but for rounding
    only_shifts = stack(UNIT, shifting, THETA)
    with pytest.raises(InputError, match="output does not vary"):
        stack_indices(only_shifts, count=64)


def test_same_numbers_with_threads() -> None:
    pair = [tolerance("crank.eccentricity", "5 um"), tolerance("sensor.encoder_eccentricity", "5 arcsec")]
    given = stack(UNIT, pair, THETA)
    with ThreadPoolExecutor(2) as pool:
        one, two = stack_indices(given, count=512), stack_indices(given, count=512, executor=pool)
    for name in ("first", "first_low", "total", "total_high"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    assert one.points == 512
    assert stack_indices(given, count=1).points == 128  # 8 points of each of 16 scrambles
    assert (stack_indices(given, count=512, seed=1).first != one.first).all()


@pytest.mark.parametrize(("settings", "words"), [({"confidence": 1.0}, "confidence = 1"), ({"seed": -1}, "seed = -1")])
def test_settings_are_checked(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        sobol_indices(additive, [0, 1, 2, 3, 4], **settings)
