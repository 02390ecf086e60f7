"""Groups that differ, means that change: planted shifts are named, sound lots raise no more alarms than agreed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy

from lot_parts import UM, RandomUnits, parts
from rverror.base.arrays import Array
from rverror.lots import differences
from rverror.lots.differences import steady, tail_chance
from rverror.lots.result import Change, Difference, Interval, Shift
from rverror.lots.shifts import Fits, ShiftedUnits, ShiftEffect, ShiftSource, candidates_of, explained, misfit, surprise

SOME, D, UNITS = RandomUnits(60, 0.25), 60, 120


def linear(sources: Sequence[ShiftSource], sizes: Sequence[Array], _: int) -> Array:
    """Units that do nothing beyond influences."""
    return np.zeros((1, len(sources), 2, D))


def alike(source: ShiftSource, sizes: Array) -> Array:
    """Units that scatter as without the shift."""
    return np.asarray(np.linalg.inv(SOME.weight))


def known(source: ShiftSource, sizes: Array) -> Array:
    """An estimate without errors."""
    return np.empty((0, len(source.columns)))


@dataclass(frozen=True)
class Shifted:
    """Units that do what influences say, and something beyond that."""

    beyond: Callable[[Sequence[ShiftSource], Sequence[Array], int], Array] = linear  # of each unit, or in their mean
    covariance: Callable[[ShiftSource, Array], Array] = alike
    uncertainty: Callable[[ShiftSource, Array], Array] = known

    def effects(self, sources: Sequence[ShiftSource], sizes: Sequence[Array], units: int) -> Array:
        first = [one.columns @ size for one, size in zip(sources, sizes, strict=True)]
        found = np.stack([first, np.negative(first)], axis=1) + self.beyond(sources, sizes, units)
        return found if found.ndim == 4 else found[None]


def group_differences(*given: Any, shifted: ShiftedUnits | None = None, **more: Any) -> tuple[Difference, ...]:
    return tuple(one for one, _ in differences.group_differences(*given, shifted=shifted or Shifted(), **more))


def changes_over_serial(*given: Any, shifted: ShiftedUnits | None = None, **more: Any) -> tuple[Change, ...]:
    return tuple(one for one, _ in differences.changes_over_serial(*given, shifted=shifted or Shifted(), **more))


@cache
def candidates() -> tuple[ShiftSource, ...]:
    return candidates_of(SOME.influence, parts())


def lot(seed: int) -> Array:
    return SOME.drawn(seed, UNITS)


def of_parts(key: str, parameter: str, **indices: int) -> ShiftSource:
    (found,) = (c for c in candidates() if (c.key, c.parameters, c.indices) == (key, (parameter,), indices))
    return found


def error_of(one: ShiftSource, times: float) -> float:
    """So many standard errors of one unit, as size."""
    return times / float(np.sqrt(one.columns[:, 0] @ SOME.weight @ one.columns[:, 0]))


def machines(seed: int) -> dict[str, tuple[str, ...]]:
    rng = np.random.default_rng(10_000 + seed)
    return {
        "machine": tuple(rng.choice(["A", "B", "C"], UNITS).tolist()),
        "shift": tuple(rng.choice(["early", "late", ""], UNITS).tolist()),
        "bench": ("only",) * UNITS,
    }


def test_what_an_estimate_leaves_unknown_of_a_shift_is_fitted_with_its_size_and_its_beginning() -> None:
    """Units stacked in one vector, with the covariance of all of them: the same squares of every size and course."""
    rng, d, units = np.random.default_rng(3), 5, 14
    own = np.linalg.inv(np.cov(rng.standard_normal((d, 40))))
    unknown = 0.4 * rng.standard_normal((3, d))
    one = ShiftSource(
        "cycloid.disc_pitch", {"disc": 0, "harmonic": 1}, ("cos",), "length", rng.normal(size=(d, 1)) / UM
    )
    courses = np.array([differences.course("ramp", at, units, units) for at in (3, 6, 9)])
    values = np.outer(2.0 * courses[1], one.columns[:, 0] * UM) + rng.standard_normal((units, d))
    shifted = Shifted(
        lambda some, *_: np.zeros((1, len(some), 2, d)), lambda *_: np.linalg.inv(own), lambda *_: unknown
    )
    found = explained(Fits.of([one], own), courses, values, own, shifted)

    def squares(course: Array, times: float) -> float:
        share = course - course.mean()
        left = (values - np.outer(share, times * one.columns @ found.effect.sizes)).ravel()
        whole = np.kron(np.eye(units), np.linalg.inv(own)) + np.kron(np.outer(share, share), unknown.T @ unknown)
        noise = np.kron(np.eye(units), np.linalg.inv(own))
        return float(left @ np.linalg.solve(whole, left) - values.ravel() @ np.linalg.solve(noise, values.ravel()))

    at = [0, 900, 1600, 2400]  # of 2401 multiples of the size, from -3 to 3
    told = np.array([[squares(course, times) for times in np.linspace(-3, 3, 2401)[at]] for course in courses])
    np.testing.assert_allclose(found.deviance[:, at] - found.deviance[0, 0], told - told[0, 0], rtol=1e-9, atol=1e-9)
    share = courses[found.course] - courses[found.course].mean()
    whole = np.linalg.inv(own) / (share @ share) + unknown.T @ unknown
    expected = 1 / float(one.columns[:, 0] @ np.linalg.solve(whole, one.columns[:, 0]))
    assert found.covariance[0, 0] / (share @ share) + found.estimate_errors[0] ** 2 == pytest.approx(expected, rel=1e-9)


def test_a_group_is_no_better_known_than_what_its_shift_does() -> None:
    """A shift that may do a tenth more or less is known to a tenth, however many units have it."""
    cam = of_parts("crank.eccentricity", "radial", crank=0, disc=0)
    size, rng = error_of(cam, 8.0), np.random.default_rng(4)
    labels = {"machine": tuple(rng.choice(["A", "B"], UNITS).tolist())}
    values = lot(5) + np.outer([value == "B" for value in labels["machine"]], size * cam.columns[:, 0])
    widths = []
    for share in (0.0, 0.1):
        shifted = Shifted(uncertainty=lambda one, sizes, share=share: share * (one.columns @ sizes)[None])
        (found,) = group_differences(values, labels, SOME.weight, [cam], shifted=shifted)
        widths.append((found.causes[0].size.high - found.causes[0].size.low) / 2)
        assert size in found.causes[0].size
    assert math.sqrt(widths[1] ** 2 - widths[0] ** 2) == pytest.approx(1.96 * 0.1 * size, rel=0.05)


def test_noise_in_what_a_shift_does_takes_nothing_from_its_size() -> None:
    """As much as in a disc's pitch at 20 N m, nine times its chi-square over the units solved: 2.2 % of 400."""
    cam = of_parts("crank.eccentricity", "radial", crank=0, disc=0)
    size, root, ratios = error_of(cam, 60.0), np.linalg.cholesky(np.linalg.inv(SOME.weight)), []
    for seed in range(24):
        own = np.random.default_rng(100 + seed).standard_normal((400, D)) @ root.T * 60.0 * math.sqrt(9 / D) / size

        def noise(_: object, sizes: Sequence[Array], units: int, own: Array = own) -> Array:
            return np.stack([np.stack([one * own[:units], -one * own[:units]], axis=1) for one in sizes], axis=1)

        share = np.random.default_rng(seed).integers(0, 2, UNITS).astype(np.float64)
        values = lot(seed) + np.outer(size * share, cam.columns[:, 0])
        found = explained(Fits.of([cam], SOME.weight), share[None], values, SOME.weight, Shifted(noise))
        ratios.append(found.effect.sizes[0] / size)
    error = math.sqrt(9 / D / 400)  # of one: the noise along the shift itself
    assert np.mean(ratios) == pytest.approx(1.0, abs=2 * error / math.sqrt(len(ratios)))


def test_the_true_part_is_beside_the_named_one_however_few_units_tell_what_parts_do() -> None:
    """Ten parts with effects alike to 3 to 10 %, and chi-squares of 243 to 300.  The mean of 50 units has noise of 0.6
    of the square of what a part does: that does not tell the ten apart."""
    root, others = np.linalg.cholesky(np.linalg.inv(SOME.weight)), []
    for noise, lots in ((0.0, 8), (0.6, 40)):
        held = 0
        for seed in range(lots):
            rng = np.random.default_rng(seed)
            share = rng.integers(0, 2, UNITS).astype(np.float64)
            times = math.sqrt(300 / np.sum((share - share.mean()) ** 2))
            directions = np.linalg.qr(rng.standard_normal((D, 11)))[0].T
            alike = np.r_[1.0, rng.uniform(0.9, 0.97, 9)][:, None]
            columns = times * (alike * directions[:1] + np.sqrt(1 - alike**2) * directions[1:]) @ root.T / 5e-3
            scatter = times * math.sqrt(50 * noise / D) * rng.standard_normal((10, 400, D)) @ root.T / 5e-3
            parts = [
                ShiftSource("crank.eccentricity", {"disc": at, "crank": 0}, ("radial",), "length", one[:, None])
                for at, one in enumerate(columns)
            ]

            def beyond(some: Sequence[ShiftSource], sizes: Sequence[Array], units: int, of: Array = scatter) -> Array:
                found = [size * of[int(one.indices["disc"]), :units] for one, size in zip(some, sizes, strict=True)]
                return np.moveaxis([found, np.negative(found)], (0, 1), (2, 1))

            values = lot(seed) + np.outer(share, columns[0] * 5e-3)
            found = explained(Fits.of(parts, SOME.weight), share[None], values, SOME.weight, Shifted(beyond))
            held += parts[0].label in (found.source.label, *found.rivals)
            others.append(len(found.rivals))
        assert held >= 0.97 * lots
    assert np.mean(others[:8]) < 1 < 5 < np.mean(others[8:])


def test_parts_move_alike_that_share_an_index() -> None:
    """Cams of two cranks and two discs: each alone, those of a disc, those of a crank, and all: nine; pins: all."""
    cams = [c for c in candidates() if c.key == "crank.eccentricity"]
    assert len({c.label for c in cams}) == 9
    assert len(cams) == 27  # radial, tangential, and both
    both = of_parts("crank.eccentricity", "radial", disc=0)
    alone = [of_parts("crank.eccentricity", "radial", crank=k, disc=0) for k in (0, 1)]
    np.testing.assert_allclose(both.columns, alone[0].columns + alone[1].columns)
    assert [c.label for c in candidates() if c.key == "cycloid.pin_radius"] == ["cycloid.pin_radius"]


def test_parts_that_do_not_show_are_no_candidates() -> None:
    """A column of a size that a thousand units would not show is rounding."""
    faint = SOME.influence * np.where(parts().process == 0, 1e-9, 1.0)
    assert parts().processes[0].key not in {c.key for c in candidates_of(faint, parts())}


def test_two_parameters_that_do_the_same_are_not_told_as_two() -> None:
    column = np.random.default_rng(0).standard_normal((D, 1))
    twice = ShiftSource("crank.index", {}, ("a", "b"), "angle", np.concatenate([column, 2 * column], axis=1))
    assert Fits.of([twice], np.eye(D)).candidates == ()


@pytest.mark.parametrize("freedom", [1, 2, 3])
def test_surprise_is_a_tail_probability_where_that_underflows_too(freedom: int) -> None:
    chi = np.array([0.0, 1.0, 20.0, 499.0, 501.0, 1300.0])
    np.testing.assert_allclose(surprise(chi, freedom), -scipy.stats.chi2.logsf(chi, freedom), rtol=1e-4, atol=1e-12)
    assert np.isfinite(surprise(np.array([1e5]), freedom)).all()


def test_tail_of_an_exponential() -> None:
    """Chance within a factor of two at e^-10, seen by 499; what nobody saw is rare, not impossible."""
    seen = -np.log1p(-(np.arange(499) + 0.5) / 499)
    assert 0.5 < tail_chance(seen, 10.0) / np.exp(-10) < 3
    assert tail_chance(seen, 0.1) == pytest.approx(np.exp(-0.1), rel=0.01)
    assert 0 < tail_chance(seen, 100.0) < 1e-12


def test_cams_of_one_disc_of_a_machine_are_named_and_nothing_else() -> None:
    """3 um are 1.8 standard errors of a unit here, 9 of the difference of the means; 5 are told mostly."""
    cams = of_parts("crank.eccentricity", "radial", disc=0)
    hits, covered = 0, 0
    for seed in range(20):
        labels = machines(seed)
        values = lot(seed)
        values[np.array(labels["machine"]) == "B"] += cams.columns[:, 0] * 3 * UM
        found = group_differences(values, labels, SOME.weight, candidates(), seed=seed)
        one = found[0]
        named = [(s.key, dict(s.indices), s.parameter) for s in one.causes]
        right = (one.label, one.value) == ("machine", "B") and named == [(cams.key, {"disc": 0}, "radial")]
        hits += len(found) == 1 and right
        covered += 3 * UM in one.causes[0].size
        assert one.units == labels["machine"].count("B")
        assert one.causes[0].dimension == "length"
    assert hits >= 19
    assert covered >= 16  # of 20 at 95 %: fewer are a chance of 0.3 %


def test_of_two_values_the_later_is_told_against_the_earlier() -> None:
    cams = of_parts("crank.eccentricity", "radial", disc=0)
    labels = {"machine": ("A", "B") * (UNITS // 2)}
    values = lot(0)
    values[::2] += cams.columns[:, 0] * error_of(cams, 3.0)
    (found,) = group_differences(values, labels, SOME.weight, candidates())
    assert found.value == "B"
    assert found.causes[0].size.high < 0


def test_two_parameters_are_told_where_both_are_off() -> None:
    one, other = (of_parts("crank.eccentricity", name, disc=0) for name in ("radial", "tangential"))
    values = lot(1)
    values[::2] += one.columns[:, 0] * error_of(one, 2) + other.columns[:, 0] * error_of(other, 2)
    (found,) = group_differences(values, {"machine": ("B", "A") * (UNITS // 2)}, SOME.weight, candidates())
    assert [s.parameter for s in found.causes] == ["radial", "tangential"]


def test_parts_that_do_the_same_are_rivals() -> None:
    cams = of_parts("crank.eccentricity", "radial", disc=0)
    twin = ShiftSource("involute.sun_offset", {}, ("x",), "length", cams.columns * 1.01)
    values = lot(2)
    values[1::2] += cams.columns[:, 0] * error_of(cams, 3.0)
    labels = {"machine": ("A", "B") * (UNITS // 2)}
    (found,) = group_differences(values, labels, SOME.weight, [*candidates(), twin])
    assert {found.causes[0].key, found.rivals[0].split()[0]} == {cams.key, twin.key}


def test_the_mirror_image_of_a_cam_is_beside_it_whatever_first_order_says() -> None:
    """Crank 1 on disc 0 of crank 0 on disc 1: contacts alone distinguish them."""
    places = [{"disc": disc, "crank": crank} for disc in (0, 1) for crank in (0, 1)]
    cams = [of_parts("crank.eccentricity", "radial", **place) for place in places]
    for one, mirror in ((0, 3), (1, 2), (2, 1), (3, 0)):
        values = lot(4)
        values[1::2] += cams[one].columns[:, 0] * error_of(cams[one], 15)
        (found,) = group_differences(values, {"machine": ("A", "B") * (UNITS // 2)}, SOME.weight, cams)
        assert (found.causes[0].indices, cams[mirror].label in found.rivals) == (places[one], True)
    fits = Fits.of(cams, SOME.weight)
    assert fits.rivals(np.array([100.0, 95.0, 20.0, 0.0]), 0) == tuple(
        one.label for one in cams[1:]
    )  # that of a rival too
    assert fits.rivals(np.array([100.0, 50.0, 20.0, 0.0]), 0) == (cams[3].label,)


def test_of_parts_that_do_the_same_the_plausible_one_is_named() -> None:
    """A twin would have to be 50 times as far off: 300 um of a sun's place."""
    cams = of_parts("crank.eccentricity", "radial", disc=0)
    twin = ShiftSource("involute.sun_offset", {}, ("x",), "length", cams.columns * 0.02)
    values = lot(2)
    values[1::2] += cams.columns[:, 0] * error_of(cams, 3.0)
    labels = {"machine": ("A", "B") * (UNITS // 2)}
    for some in ([twin, *candidates()], [*candidates(), twin]):
        (found,) = group_differences(values, labels, SOME.weight, some)
        assert found.causes[0].key == cams.key
        change, *_ = changes_over_serial(np.concatenate([values[::2], values[1::2]]), SERIALS, SOME.weight, some)
        assert change.cause.key == cams.key


def test_what_the_first_order_lacks_names_no_implausible_part() -> None:
    """A twin of its plausible size, two standard deviations, takes a tenth more of what a large shift does beyond the
    first order: worth 4 in units of the noise, which the gain exceeds, and 4 times the misfit of what influences leave.
    """
    cams = of_parts("crank.eccentricity", "radial", disc=0)
    size, root = error_of(cams, 6.0), np.linalg.cholesky(np.linalg.inv(SOME.weight))
    lacks = 3.0 * root @ np.random.default_rng(3).standard_normal(D)
    columns = (cams.columns[:, 0] + 0.1 * lacks / size) * 0.1
    twin = ShiftSource("involute.sun_offset", {}, ("x",), "length", columns[:, None])
    assert size / 0.1 / twin.plausible == pytest.approx(1.0, rel=0.05)
    values = lot(2)
    values[1::2] += cams.columns[:, 0] * size + lacks
    (found, *_) = group_differences(values, {"machine": ("A", "B") * (UNITS // 2)}, SOME.weight, [*candidates(), twin])
    assert found.causes[0].key == cams.key


def test_too_few_units_or_no_others_tell_nothing() -> None:
    values = lot(3)
    values[:4] += 100
    few = ("B",) * 4 + ("A",) * (UNITS - 4)
    each = tuple(map(str, range(UNITS)))
    labels = {"machine": few, "serial": each, "none": ("",) * UNITS, "one": ("A",) * UNITS}
    assert group_differences(values, labels, SOME.weight, candidates()) == ()


def test_sound_lots_raise_no_more_alarms_than_agreed() -> None:
    """Of 40 lots 0.4 at 1 %: more than 3 are a chance of 1 in 1400.  At 30 % there are 12, less or more 2.9."""
    found = [group_differences(lot(s), machines(s), SOME.weight, candidates(), level=0.3, seed=s) for s in range(40)]
    assert sum(one[0].chance < 0.01 for one in found if one) <= 3
    assert 4 <= sum(len(one) > 0 for one in found) <= 21


SERIALS = [f"U{number:04d}" for number in range(UNITS)]


def test_ramp_is_found_where_it_begins() -> None:
    """From 60 % of the units on, to 6 standard errors of a unit at the last."""
    cams = of_parts("crank.eccentricity", "radial", disc=0)
    size, begins = error_of(cams, 6.0), int(0.6 * UNITS)
    course = np.maximum(np.arange(UNITS) - begins, 0) / (UNITS - 1 - begins)
    near, covered, between = 0, 0, 0
    for seed in range(20):
        found = changes_over_serial(
            lot(seed) + np.outer(course * size, cams.columns[:, 0]), SERIALS, SOME.weight, candidates(), seed=seed
        )
        one = found[0]
        assert (one.cause.key, dict(one.cause.indices), one.cause.parameter) == (cams.key, {"disc": 0}, "radial")
        near += one.course == "ramp" and abs(SERIALS.index(one.since) - begins) <= 0.1 * UNITS
        covered += size in one.cause.size
        between += one.since_interval[0] <= SERIALS[begins] <= one.since_interval[1]
        assert SERIALS.index(one.since_interval[1]) - SERIALS.index(one.since_interval[0]) <= 0.4 * UNITS
    assert near >= 19
    assert covered >= 16  # of 20 at 95 %: fewer are a chance of 0.3 %
    assert between >= 17


def test_step_is_found_at_its_unit() -> None:
    cams = of_parts("crank.eccentricity", "radial", disc=0)
    values = lot(4)
    values[80:] += cams.columns[:, 0] * error_of(cams, 4.0)
    (found,) = changes_over_serial(values, SERIALS, SOME.weight, candidates())
    assert found.course == "step"
    assert abs(SERIALS.index(found.since) - 80) <= 2
    assert found.since_interval[0] <= SERIALS[80] <= found.since_interval[1]
    assert error_of(cams, 4.0) in found.cause.size
    assert found.chance < 1e-3


def test_the_interval_of_a_beginning_holds_those_between_the_ones_that_are_tried() -> None:
    cams = of_parts("crank.eccentricity", "radial", disc=0)
    for first in range(60, 72):
        values = lot(first)
        values[first:] += cams.columns[:, 0] * error_of(cams, 10.0)
        found, *_ = changes_over_serial(values, SERIALS, SOME.weight, [cams])
        earliest, latest = map(SERIALS.index, found.since_interval)
        assert earliest <= first <= latest < earliest + 5


def test_what_units_scatter_and_what_a_change_leaves_widen_its_interval() -> None:
    """A step of 20 errors of a unit: with three times the errors along it, which the weight does not know, the interval
    is three times as wide; with a misfit beside it as many times as its root."""
    cams = of_parts("crank.eccentricity", "radial", disc=0)
    column, rng = cams.columns[:, 0], np.random.default_rng(9)
    clean, odd = lot(5), rng.standard_normal(D)
    clean[61:] += column * error_of(cams, 20.0)
    odd -= column * (odd @ SOME.weight @ column) / (column @ SOME.weight @ column)
    left = odd * 3 / math.sqrt(odd @ SOME.weight @ odd)
    scattered, missed = (
        clean + np.outer(rng.standard_normal(UNITS), column * error_of(cams, math.sqrt(8.0))),
        clean.copy(),
    )
    missed[61:] += left
    widths = []
    for values in (clean, scattered, missed):
        found, *_ = changes_over_serial(values, SERIALS, SOME.weight, [cams])
        widths.append(found.cause.size.high - found.cause.size.low)
    units = 61 * (UNITS - 61) / UNITS  # a difference of two means is known as well as by so many
    misfit_of = 1 + units * float(left @ SOME.weight @ left) / (D - 1)
    assert widths[1] / widths[0] == pytest.approx(3.0, rel=0.25)
    assert widths[2] / widths[0] == pytest.approx(math.sqrt(misfit_of), rel=0.25)


def test_a_beginning_is_less_sure_where_units_scatter_more_behind_it() -> None:
    """Units with the shift have four times the standard error along it: of 20 intervals at 95 % fewer than 17 hold the
    beginning by a chance of 0.3 %."""
    cams = of_parts("crank.eccentricity", "radial", disc=0)
    column, rng, held = cams.columns[:, 0], np.random.default_rng(12), 0
    wide = np.linalg.inv(SOME.weight) + 15 * np.outer(column, column) * error_of(cams, 1.0) ** 2
    for seed in range(20):
        values = lot(300 + seed)
        more = 4 + math.sqrt(15) * rng.standard_normal(20)
        values[100:] += np.outer(more * error_of(cams, 1.0), column)
        found, *_ = changes_over_serial(
            values, SERIALS, SOME.weight, [cams], shifted=Shifted(covariance=lambda *_: wide)
        )
        held += found.since_interval[0] <= SERIALS[100] <= found.since_interval[1]
    assert held >= 17


def test_sound_lots_do_not_change() -> None:
    """As of groups."""
    found = [changes_over_serial(lot(s), SERIALS, SOME.weight, candidates(), level=0.3, seed=s) for s in range(40)]
    assert sum(one[0].chance < 0.01 for one in found if one) <= 3
    assert 4 <= sum(len(one) > 0 for one in found) <= 21


def test_what_a_large_change_does_beyond_the_first_order_is_no_change_of_its_own() -> None:
    """A ramp of 20 errors of a unit, and with its square 5 along the encoder: one change, where it begins."""
    cams, beyond = of_parts("crank.eccentricity", "radial", disc=0), of_parts("sensor.encoder_eccentricity", "cos")
    course = np.maximum(np.arange(UNITS) - 79, 0) / (UNITS - 80)
    values = lot(4) + np.outer(course * error_of(cams, 20), cams.columns[:, 0])
    values += np.outer(course**2 * error_of(beyond, 5), beyond.columns[:, 0])
    (found,) = changes_over_serial(values, SERIALS, SOME.weight, candidates())
    assert found.cause.key == cams.key
    assert abs(SERIALS.index(found.since) - 80) <= 8
    assert misfit(np.full(D, math.sqrt(30.0 / D)), 1) == 1.0
    assert misfit(np.full(D, math.sqrt((2.0 * D - 2.0) / D)), 1) == pytest.approx(2.0)


def test_what_a_cause_leaves_widens_its_interval_and_brings_rivals() -> None:
    """Beside a shift of 20 errors of a unit one of 10 that no part explains."""
    cams = of_parts("crank.eccentricity", "radial", disc=0)
    twin = ShiftSource("involute.sun_offset", {}, ("x",), "length", cams.columns + 0.02 * np.linalg.norm(cams.columns))
    clean, odd = lot(5), np.random.default_rng(9).standard_normal(D)
    clean[1::2] += cams.columns[:, 0] * error_of(cams, 20)
    beyond = clean.copy()
    beyond[1::2] += odd * 10 / math.sqrt(odd @ SOME.weight @ odd)
    labels = {"machine": ("A", "B") * (UNITS // 2)}
    one, other = (group_differences(v, labels, SOME.weight, [cams, twin])[0] for v in (clean, beyond))
    widths = [some.causes[0].size.high - some.causes[0].size.low for some in (one, other)]
    left = odd * 10 / math.sqrt(odd @ SOME.weight @ odd) * math.sqrt(UNITS / 4)
    expected = math.sqrt(1 + float(left @ SOME.weight @ left) / (D - 1))
    assert widths[1] / widths[0] == pytest.approx(expected, rel=0.2)
    assert len(other.rivals) >= len(one.rivals)


def test_a_second_change_is_found_in_the_steady_part() -> None:
    cams, encoder = of_parts("crank.eccentricity", "radial", disc=0), of_parts("sensor.encoder_eccentricity", "cos")
    step, ramp = np.arange(UNITS) >= 30, np.maximum(np.arange(UNITS) - 89, 0) / (UNITS - 90)
    values = lot(6) + np.outer(step * error_of(cams, 3), cams.columns[:, 0])
    values += np.outer(ramp * error_of(encoder, 12), encoder.columns[:, 0])
    found = changes_over_serial(values, SERIALS, SOME.weight, candidates())
    assert {one.cause.key for one in found} == {cams.key, encoder.key}


def test_steady_is_what_stands_before_a_ramp_and_on_the_longer_side_of_a_step() -> None:
    def change(since: int, course: str) -> Change:
        shift = Shift("crank.index", {"crank": 0}, "angle", "angle", Interval(1.0, 0.5, 1.5))
        return Change(SERIALS[since], (SERIALS[since],) * 2, course, 0.0, shift)

    assert steady([], SERIALS) == slice(0, UNITS)
    assert steady([change(20, "ramp")], SERIALS) == slice(0, 20)
    assert steady([change(20, "step")], SERIALS) == slice(20, UNITS)
    assert steady([change(100, "step"), change(30, "step"), change(80, "ramp")], SERIALS) == slice(30, 80)


def test_a_difference_of_four_errors_is_found_in_most_lots() -> None:
    """Between halves of a lot: a unit's information times a quarter of the units.  In 95 %: 16 of 20 lots or more."""
    cam = of_parts("crank.eccentricity", "radial", crank=0, disc=0)
    column, labels = cam.columns[:, 0], {"machine": ("A", "B") * (UNITS // 2)}
    information = column @ SOME.weight @ column * UNITS / 4
    far = scipy.stats.norm.isf(0.0025 / len(candidates())) + scipy.stats.norm.ppf(0.95)
    size = float(far / np.sqrt(information))
    hits = [0, 0]
    for seed in range(20):
        for at, share in enumerate((1.0, 0.5)):
            values = lot(100 + seed)
            values[1::2] += column * size * share
            hits[at] += bool(group_differences(values, labels, SOME.weight, candidates(), level=0.005, seed=seed))
    assert hits[0] >= 16
    assert hits[1] <= 10  # half of it is 2.6 errors, for 4 that are asked


def test_a_large_shift_is_told_by_what_it_does_beyond_the_first_order() -> None:
    """A ramp of cams to 8 errors of a unit does, by its square, 20 along the encoder: influences alone tell an encoder
    that begins late; solved, the cams with their size and beginning."""
    cams, encoder = of_parts("crank.eccentricity", "radial", disc=0), of_parts("sensor.encoder_eccentricity", "cos")
    size, bend = error_of(cams, 8), encoder.columns[:, 0] * error_of(encoder, 20)
    share = np.maximum(np.arange(UNITS) - 59, 0) / (UNITS - 60)
    values = lot(7) + np.outer(share * size, cams.columns[:, 0]) + np.outer(share**2, bend)

    def beyond(sources: Sequence[ShiftSource], sizes: Sequence[Array], _: int) -> Array:
        own = [one.label == cams.label and one.parameters == cams.parameters for one in sources]
        found = [at * (given[0] / size) ** 2 * bend for at, given in zip(own, sizes, strict=True)]
        return np.stack([found, found], axis=1)

    (first, *_) = changes_over_serial(values, SERIALS, SOME.weight, candidates())
    assert first.cause.key == encoder.key
    (found,) = changes_over_serial(values, SERIALS, SOME.weight, candidates(), shifted=Shifted(beyond))
    assert (found.cause.key, dict(found.cause.indices), found.cause.parameter) == (cams.key, {"disc": 0}, "radial")
    assert size in found.cause.size
    assert abs(SERIALS.index(found.since) - 60) <= 6


def test_the_scatter_that_counts_is_that_of_the_size_which_is_told() -> None:
    """Fifty units show a third of what cams of 8 errors do along the encoder, 200 all: until then they seem larger."""
    cams, encoder = of_parts("crank.eccentricity", "radial", disc=0), of_parts("sensor.encoder_eccentricity", "cos")
    size, bend = error_of(cams, 8), encoder.columns[:, 0] * error_of(encoder, 20)
    asked = list[float]()

    def beyond(sources: Sequence[ShiftSource], sizes: Sequence[Array], units: int) -> Array:
        own = [(one.label, one.parameters) == (cams.label, cams.parameters) for one in sources]
        shown = bend if units > 50 else 0.3 * bend
        found = [at * (given[0] / size) ** 2 * shown for at, given in zip(own, sizes, strict=True)]
        return np.stack([found, found], axis=1)

    def covariance(one: ShiftSource, sizes: Array) -> Array:
        assert one.label == cams.label
        asked.extend(sizes)
        return alike(one, sizes)

    values, labels = lot(7), {"machine": ("A", "B") * (UNITS // 2)}
    values[1::2] += cams.columns[:, 0] * size + bend
    found = group_differences(values, labels, SOME.weight, [cams, encoder], shifted=Shifted(beyond, covariance))
    assert asked[0] > 1.3 * size
    assert asked[-1] == pytest.approx(found[0].causes[0].size.value, rel=0.1)


def test_a_large_difference_has_the_size_and_error_of_what_the_opposites_show() -> None:
    """Beside what it does to first order, 20 errors of a unit along the encoder whatever the sign, and 10 with it."""
    cams, encoder = of_parts("crank.eccentricity", "radial", disc=0), of_parts("sensor.encoder_eccentricity", "cos")
    other = of_parts("sensor.encoder_eccentricity", "sin")
    size, even = error_of(cams, 8), encoder.columns[:, 0] * error_of(encoder, 20)
    odd = other.columns[:, 0] * error_of(other, 10)

    def beyond(sources: Sequence[ShiftSource], sizes: Sequence[Array], _: int) -> Array:
        found = []
        for one, given in zip(sources, sizes, strict=True):
            times = given[0] / size * (one.label == cams.label and one.parameters == cams.parameters)
            found.append([times**2 * even + times * odd, times**2 * even - times * odd])
        return np.array(found)

    labels, covered = {"machine": ("A", "B") * (UNITS // 2)}, 0
    for seed in range(20):
        values = lot(seed)
        values[1::2] += cams.columns[:, 0] * size + even + odd
        found, *_ = group_differences(
            values, labels, SOME.weight, candidates(), shifted=Shifted(beyond)
        )  # one is by chance
        (one,) = found.causes
        assert (one.key, dict(one.indices), one.parameter) == (cams.key, {"disc": 0}, "radial")
        slope = (cams.columns[:, 0] * size + 2 * even + odd) / size
        error = 2 / math.sqrt(UNITS * (slope @ SOME.weight @ slope))
        assert (one.size.high - one.size.low) / 2 == pytest.approx(1.98 * error, rel=0.35)
        covered += size in one.size
    assert covered >= 16  # of 20 at 95 %: fewer are a chance of 0.3 %


def test_halves_of_a_shift_tell_that_it_grows_as_its_fourth_power() -> None:
    """A ramp of cams to 8 errors of a unit does 12 along the encoder, most of it near the end: as a square it would
    begin 20 units later and be an eighth smaller."""
    cams, encoder = of_parts("crank.eccentricity", "radial", disc=0), of_parts("sensor.encoder_eccentricity", "cos")
    size, bend = error_of(cams, 8), encoder.columns[:, 0] * error_of(encoder, 12)
    share = np.maximum(np.arange(UNITS) - 39, 0) / (UNITS - 40)
    values = lot(8) + np.outer(share * size, cams.columns[:, 0]) + np.outer((share**4 + share**3) / 2, bend)

    def beyond(sources: Sequence[ShiftSource], sizes: Sequence[Array], _: int) -> Array:
        own = [one.label == cams.label and one.parameters == cams.parameters for one in sources]
        times = [at * given[0] / size for at, given in zip(own, sizes, strict=True)]
        return np.array([[(t**4 + t**3) / 2 * bend, (t**4 - t**3) / 2 * bend] for t in times])

    (found,) = changes_over_serial(values, SERIALS, SOME.weight, candidates(), shifted=Shifted(beyond))
    assert (found.cause.key, found.course) == (cams.key, "ramp")
    assert size in found.cause.size
    assert found.cause.size.high - found.cause.size.low < 0.1 * size
    assert found.since_interval[0] <= SERIALS[40] <= found.since_interval[1] < SERIALS[50]


def test_a_difference_is_weighed_by_the_covariance_of_both_sides() -> None:
    """A third of the units have the shift and five times the errors along the encoder: the size is that of generalised
    least squares with the covariance of the difference of two means, C0 / n0 + C1 / n1."""
    cams, encoder = of_parts("crank.eccentricity", "radial", disc=0), of_parts("sensor.encoder_eccentricity", "cos")
    column, wide = cams.columns[:, 0], encoder.columns[:, 0] * error_of(encoder, 5)
    inside, rng = np.arange(UNITS) % 3 == 1, np.random.default_rng(3)
    labels = {"machine": tuple("AB"[int(one)] for one in inside)}
    sound = np.linalg.inv(SOME.weight)
    more, sizes = sound + np.outer(wide, wide), list[float]()
    for seed in range(20):
        values = lot(200 + seed)
        values[inside] += column * error_of(cams, 3) + np.outer(rng.standard_normal(inside.sum()), wide)
        found, *_ = group_differences(
            values, labels, SOME.weight, [cams], shifted=Shifted(covariance=lambda *_: more), seed=seed
        )
        (one,) = found.causes
        pressed = np.linalg.solve(sound / np.sum(~inside) + more / inside.sum(), column)
        size = pressed @ (values[inside].mean(axis=0) - values[~inside].mean(axis=0)) / (pressed @ column)
        assert one.size.value == pytest.approx(size, rel=2e-3)
        sizes.append(one.size.value)
        assert (one.size.high - one.size.low) / 2 == pytest.approx(1.99 / math.sqrt(pressed @ column), rel=0.35)
    assert np.std(sizes) == pytest.approx(1 / math.sqrt(pressed @ column), rel=0.5)


def test_a_share_of_a_shift_is_a_smaller_shift() -> None:
    rng, share = np.random.default_rng(0), np.array([0.0, 0.5, 1.0])
    effect = ShiftEffect(np.array([2.0]), rng.standard_normal((4, D)), rng.standard_normal((3, 4, D)))
    np.testing.assert_allclose(effect.times(-3.0).of(share), effect.of(-3.0 * share))
    np.testing.assert_allclose(effect.of(share)[1], 0.5 ** np.arange(1, 5) @ effect.powers)
    one = ShiftEffect(effect.sizes, effect.errors[0], effect.errors)
    np.testing.assert_allclose(effect.times(-3.0).errors[0], one.times(-3.0).powers)
    assert effect.times(-3.0).sizes == pytest.approx(np.array([-6.0]))
    ones = [0.1 * ShiftEffect(effect.sizes, own, effect.errors).of(np.ones(1))[0] for own in effect.errors]
    share = sum(one @ SOME.weight @ one for one in ones) / (
        effect.of(np.ones(1))[0] @ SOME.weight @ effect.of(np.ones(1))[0]
    )
    assert effect._replace(errors=0.1 * effect.errors).noise(SOME.weight) == pytest.approx(share)
    assert effect._replace(errors=9.0 * effect.errors).noise(SOME.weight) == 0.5


def test_a_second_parameter_has_to_be_worth_more_where_the_best_leaves_a_misfit() -> None:
    some = [one for one in candidates() if one.label == "crank.eccentricity (disc 0)"]
    fits = Fits.of(some, SOME.weight)
    chi = np.where(fits.freedom == 2, 110.0, np.where(np.arange(3) == 0, 100.0, 0.0))
    assert fits.freedom[fits.best(chi)] == 2
    assert fits.freedom[fits.best(chi, 2.0)] == 1
