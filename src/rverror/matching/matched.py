"""The way in: measured parts of a lot become units that keep their limits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import scipy

from rverror.base.arrays import Array, Integers
from rverror.base.errors import InputError, check_each, refusing
from rverror.base.numbers import count_of
from rverror.base.progress import Progress
from rverror.base.threads import each
from rverror.base.units import ARCSEC
from rverror.geartrain.mechanism import Reducer
from rverror.matching.at_load import PlacedErrors, UnitsAtLoad, columns_of
from rverror.matching.result import Matched, MatchedUnit, MountedPart, WayToBuild
from rverror.matching.unit_waves import Assembly, UnitWaves, placed, section_sizes
from rverror.model.effects import Model, check_model
from rverror.parts.measured import KINDS, MeasuredPart, Place, at_first_place, mounted, places_of
from rverror.tolerances.loaded_yield import counted
from rverror.tolerances.sampling import check_seed
from rverror.tolerances.specification import Limit, check_limits

#: Ways to build that a cost can be given for.
WAYS = ("classes", "sorting", "matching", "turning", "rollers", "tighter")
#: Errors of tighter parts, of those given: an illustration.
TIGHTER = 0.8

_RANDOM = 30, 200  # units put together at random: two lots, but no fewer and about no more than these
_SAMPLE = 24  # of them, from which the mean influence is taken
_IDLE = 2  # rounds of exchanges at the load that bring nothing
_SURE = 0.01  # chance of being bad with which a unit is good enough
_DRAWS = 256  # of a unit's sizes within their uncertainty
_KNOWN = 8  # units that suffice to estimate the doubt anew
_CLASSES = 3


def match(
    model: Model,
    parts: Sequence[MeasuredPart],
    limits: Sequence[Limit],
    *,
    turns: bool = False,
    costs: Mapping[str, float] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Matched:
    """Say which measured parts to join so that the most units meet limits at the load.

    Parameters
    ----------
    model : Model
        Of the unit, without the errors of these parts; kinds of which there is no part are as it has them.
    parts : sequence of MeasuredPart
        Such as `load_parts(...)` has.
    limits : sequence of Limit
        Of the transmission error, which is kept in both directions, the lost motion and the backlash.
    turns : bool
        Whether discs may be turned by pitches of their bores where they fit in several ways, which they do not with two
        cranks, and a sun put in at any tooth.
    costs : mapping of str to float, optional
        What a way to build costs for each unit: some of `WAYS`.
    seed : int
        Of the random assemblies.
    progress : callable, optional
        Called with a line of text as the work goes on.

    Returns
    -------
    Matched

    Raises
    ------
    InputError
        If there are too few parts, a serial number comes twice, an error does not fit, or no unit meets the limits.
    """
    check_model(model)
    check_seed(seed)
    lot = _lot_of(model, parts, turns=turns, seed=seed)
    if any(one.quantity == "stiffness" or one.value is None for one in limits if isinstance(one, Limit)):
        raise InputError("limits: match takes values of angles; leave the stiffness out, and give each limit its value")
    units = UnitsAtLoad(model, lot.columns.components, check_limits(limits, model.mechanism))
    for name in costs or {}:
        if name not in WAYS:
            raise InputError(f"costs: {name!r} is no way to build; give one of {', '.join(WAYS)}")
    rng, at_load = np.random.default_rng(seed), _AtLoad(lot, units, progress, costs or {})
    numbers = [*map(len, lot.parts), *([len(lot.kits)] if lot.rollers else [])]
    blank = UnitWaves(np.zeros(1), [np.zeros((1, n, 1)) for n in numbers], lot.pools, ())
    drawn = [blank.shuffled(rng) for _ in range(-(-min(max(_RANDOM[0], 2 * blank.most), _RANDOM[1]) // blank.most))]
    together = Assembly(np.concatenate([one.part for one in drawn]), np.concatenate([one.turn for one in drawn]))
    random = at_load.built("units put together at random", together)
    at_load, waves = at_load.waves(random)
    plain = replace(waves, parts=[one[:1] for one in waves.parts])
    ways = [at_load.way("put together at random", random)]
    classes = at_load.built("units of three classes", at_load.in_classes(plain, rng))
    ways.append(at_load.way("three classes", classes, "classes"))
    if lot.rollers:
        alike = at_load.built("units with rollers of one size", together, at_load.of_one_size(together))
        ways.append(at_load.way("rollers of one size in a unit, at random", alike, "sorting"))
    tighter = replace(random, turns=at_load.solved("units of tighter parts", TIGHTER * lot.values(together)))
    name = f"parts {100 * (1 - TIGHTER):.0f} % more accurate, at random"
    ways.append(at_load.way(name, tighter, "tighter", size=TIGHTER))
    turned = any(len(place.turns) > 1 for place in lot.places)
    if turned:
        alone = at_load.built("units turned", waves.turned(drawn[0]))
        ways.append(at_load.way("turned, not matched", alone, "turning"))
    built, bound = at_load.matched(plain, rng, "matched units")
    ways.append(at_load.way("matched", built, "matching"))
    if turned:
        built, bound = at_load.matched(waves, rng, "matched units, turned")
        ways.append(at_load.way("matched and turned", built, "matching", "turning"))
    if lot.rollers:
        built = at_load.placed(waves, built)
        ways.append(at_load.way("rollers placed as well", built, "matching", *["turning"] * turned, "rollers"))
    return _result(at_load, built, ways, bound, waves.doubt)


# --- the lot ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _PartsAtPlaces:
    """Parts of a lot, and what their errors are at each place."""

    model: Model
    reducer: Reducer
    places: tuple[Place, ...]  #: of all parts but rollers
    parts: tuple[tuple[MeasuredPart, ...], ...]  #: for each place
    pools: tuple[int, ...]  #: of these places, then that of the kits of rollers, where there are any
    columns: PlacedErrors  #: of these places, then of the grooves
    before: Mapping[str, int]  #: pitches by which a disc was turned to be as those of the first place that it fits
    rollers: tuple[MeasuredPart, ...]  #: single ones and classes
    kits: Integers  #: (kits, pins): which of them, in arbitrary order
    notes: tuple[str, ...]

    def values(self, assembly: Assembly, rollers: Integers | None = None) -> Array:
        """Components of units, shape (units, components); their rollers by groove, where not as the kits have them."""
        total = np.zeros((len(assembly.part), len(self.columns.components)))
        for place in range(len(self.parts)):
            total += self.columns.values(place, assembly.part[:, place], assembly.turn[:, place])
        used = self.in_grooves(assembly) if rollers is None else rollers
        for groove in range(used.shape[1]):
            total += self.columns.values(len(self.parts) + groove, used[:, groove], np.zeros(len(used), dtype=int))
        return total

    def true(self, assembly: Assembly, rollers: Integers | None = None) -> tuple[Array, Array]:
        """What the true components differ by from those of the measured sizes: mean and 1 sigma."""
        of = (replace(self, columns=each) for each in (self.columns.regression, self.columns.variances))
        mean, variance = (each.values(assembly, rollers) for each in of)
        return mean, np.asarray(np.sqrt(variance))

    def in_grooves(self, assembly: Assembly) -> Integers:
        """Rollers in the grooves of each unit as its kit has them; in none where there are no kits."""
        return self.kits[assembly.part[:, -1]] if self.rollers else np.empty((len(assembly.part), 0), np.intp)

    def waves(self, slope: Array) -> list[Array]:
        """Waves of the parts at every place, turned by each of its ways."""
        found = [self.columns.waves(place, slope) for place in range(len(self.parts))]
        if len(self.kits):
            grooves = [self.groove(n, slope)[self.kits[:, n]] for n in range(self.reducer.pins)]
            found.append(np.asarray(np.sum(grooves, axis=0)[None]))
        return found

    def groove(self, number: int, slope: Array) -> Array:
        """Waves of all rollers in one groove, shape (rollers, samples)."""
        return np.asarray(self.columns.waves(len(self.parts) + number, slope)[0])


def _lot_of(model: Model, parts: Sequence[MeasuredPart], *, turns: bool, seed: int) -> _PartsAtPlaces:
    """Sort parts by the places that take them, or refuse them."""
    if not isinstance(model.mechanism, Reducer):
        raise InputError("match: a [drive] has no parts that are matched; give the model of a [reducer]")
    reducer = model.mechanism
    check_each("parts", parts, MeasuredPart, "give load_parts(path, mechanism).parts")
    if not parts:
        raise InputError("parts: there is none; give measured parts of two kinds or more")
    _check_parts(reducer, parts)
    turned = {part.serial: at_first_place(part, reducer) for part in parts if part.kind == "disc"}
    parts = [turned[part.serial][0] if part.kind == "disc" else part for part in parts]
    given = {kind: [part for part in parts if part.kind == kind] for kind in KINDS}
    places = [p for kind in KINDS if given[kind] and kind != "roller" for p in places_of(reducer, kind, turns=turns)]
    fits = {p: tuple(part for part in given[p.kind] if part.made_for == p.made_for) for p in places}
    named = [(p.kind, p.made_for) for p in places]
    pools = [list(dict.fromkeys(named)).index(name) for name in named]
    for p, name in zip(places, named, strict=True):
        if len(fits[p]) < named.count(name):
            made = f" made for place {p.number}, where others fit than at place 0 (made_for)" if p.made_for else ""
            raise InputError(f"{count_of(len(fits[p]), p.kind)}{made}: a unit takes {named.count(name)}; measure more")
    rollers, kits = tuple(given["roller"]), np.empty((0, reducer.pins), dtype=np.intp)
    notes = []
    if rollers:
        single = np.repeat(np.arange(len(rollers)), [part.count for part in rollers])
        if single.size < reducer.pins:
            raise InputError(f"{count_of(single.size, 'roller')}: a unit takes {reducer.pins}; measure more")
        whole = single.size // reducer.pins
        kits = np.random.default_rng(seed).permutation(single)[: whole * reducer.pins].reshape(whole, -1)
        pools.append(len(set(pools)))
    if not places or (len(pools) == 1 and not rollers):
        raise InputError(f"parts of the kind {parts[0].kind} alone leave nothing to choose; add those of another kind")
    if not any(part.errors for part in parts):
        raise InputError("no part has an error: nothing is to be matched; give the measured ones")
    lots = [(p, fits[p]) for p in places] + [(p, rollers) for p in places_of(reducer, "roller") if rollers]
    if turns and all(len(place.turns) == 1 for place in places):
        notes.append("turns: discs fit in one way only, and a housing turned by pins shifts the waveform as a whole")
    if missing := [kind for kind in KINDS if not given[kind] and kind != "roller"]:
        notes.append(f"no measured parts of the kinds {', '.join(missing)}: as the model has them")
    columns = columns_of(reducer, lots)
    declared = {(e.key, frozenset(e.indices.items())) for e in model.effects}
    for one in columns.components:
        if (one.key, frozenset(one.indices.items())) in declared:
            raise InputError(
                f"{one.key}: the model declares it, and parts have it as measured; take it out of the model"
            )
    return _PartsAtPlaces(
        model,
        reducer,
        tuple(places),
        tuple(fits[p] for p in places),
        tuple(pools),
        columns,
        {serial: turn for serial, (_, turn) in turned.items()},
        rollers,
        kits,
        tuple(notes),
    )


def _check_parts(reducer: Reducer, parts: Sequence[MeasuredPart]) -> None:
    """Refuse serial numbers that come twice, and errors that the mechanism does not have."""
    twice = [name for name, number in Counter((part.kind, part.serial) for part in parts).items() if number > 1]
    if twice:
        where = " and ".join(dict.fromkeys(p.origin or "the list" for p in parts if (p.kind, p.serial) == twice[0]))
        more = f", and {len(twice) - 1} more" if len(twice) > 1 else ""
        raise InputError(f"{' '.join(twice[0])}: this serial number comes twice, in {where}{more}; keep one")
    for part in parts:
        errors = part.at(places_of(reducer, part.kind)[0].number)
        most = reducer.discs - 1 if part.kind == "disc" else 0
        if not 0 <= part.made_for <= most:
            raise InputError(f"{part.kind} {part.serial}: made_for = {part.made_for}: must be from 0 to {most}")
        with refusing(f"{part.kind} {part.serial}: "):
            Model(reducer, errors)


# --- the work ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Built:
    """Units as they are put together, and their true turns."""

    assembly: Assembly
    turns: Array  # (units, quantities), rad
    rollers: Integers | None = None


@dataclass(frozen=True)
class _AtLoad:
    """A lot and its units at the load."""

    lot: _PartsAtPlaces
    units: UnitsAtLoad
    progress: Progress | None
    costs: Mapping[str, float]  #: for each unit, of some of `WAYS`
    base: Array = field(default_factory=lambda: np.empty(0))  #: (samples,): of a unit without errors, over the limits
    slope: Array = field(default_factory=lambda: np.empty((0, 0)))  #: (components, samples): of units at random

    def errors(self, turns: Array) -> Array:
        """Largest quantity of each unit, over its limit."""
        return np.asarray((turns / self.units.allowed).max(axis=1))

    def solved(self, what: str, values: Array) -> Array:
        """True turns of units, with progress."""
        return self.units.solved(values, progress=counted(self.progress, what, len(values)))

    def built(self, what: str, assembly: Assembly, rollers: Integers | None = None) -> _Built:
        """Units put together so."""
        return _Built(assembly, self.solved(what, self.lot.values(assembly, rollers)), rollers)

    def way(self, name: str, built: _Built, *paid: str, size: float = 1.0) -> WayToBuild:
        """What a way to build gives, paid as some of `WAYS`, with the parts' errors as they are or of another size."""
        errors, costs = self.errors(built.turns), [self.costs[one] for one in paid if one in self.costs]
        outcomes = errors[:, None] + self.unknown(built, size=size)
        return WayToBuild(name, built.turns, errors, outcomes, sum(costs) if costs else None)

    def unknown(self, built: _Built, *, size: float = 1.0) -> Array:
        """What draws within the uncertainty of the parts' sizes add to each unit's error, shape (units, draws)."""
        values = self.lot.values(built.assembly, built.rollers)
        means, sigmas = self.lot.true(built.assembly, built.rollers)
        if not sigmas.any():
            return np.zeros((len(values), 1))
        law, slope = UnitWaves(self.base, (), (), self.units.sections), self.slope.astype(np.float32)
        normal = np.random.default_rng(0).standard_normal((_DRAWS, len(slope)), dtype=np.float32)

        def unit(row: tuple[Array, ...]) -> Array:
            wave, mean, sigma = row
            return law.errors(wave + (mean + normal * sigma) @ slope) - law.errors(wave)

        whole = self.base + size * values @ self.slope
        rows = (one.astype(np.float32) for one in (whole, means, sigmas))
        return np.array(each(unit, list(zip(*rows, strict=True))))

    def uncertain(self, waves: UnitWaves, built: _Built) -> UnitWaves:
        """These waves with what the uncertainty of the sizes does to such units."""
        added = self.unknown(built)
        return replace(waves, shift=float(added.mean()), unsure=float(added.std()))

    def waves(self, random: _Built) -> tuple[_AtLoad, UnitWaves]:
        """Waves of all parts, from units put together at random: by their mean influence, which is kept.

        Each quantity is scaled to the mean of the true ones: few angles miss the peaks.
        """
        values, turns, some = self.lot.values(random.assembly), random.turns, slice(0, _SAMPLE)
        waves, slope = self.units.waves(values[some], slopes=True)
        if not slope.size:
            raise InputError("no equilibrium of any unit at this load; check the sizes of the parts' errors, and --at")
        base = np.nanmean(waves - values[some] @ slope, axis=0)
        linear, known = base + values @ slope, np.isfinite(turns).all(axis=1)
        sizes = section_sizes(linear, self.units.sections)
        for number, (at, _) in enumerate(self.units.sections):
            size = sizes[number][known].sum()
            scale = (turns[known, number] / self.units.allowed[number]).sum() / size if size > 0 else 1.0
            base[at], slope[:, at] = base[at] * scale, slope[:, at] * scale
        made = UnitWaves(base.astype(np.float32), self.lot.waves(slope), self.lot.pools, self.units.sections)
        difference = self.errors(turns[known]) - made.errors(base + values[known] @ slope)
        law = replace(self, base=base, slope=slope)
        return law, law.uncertain(replace(made, doubt=max(float(difference.std()), 1e-3)), random)

    def matched(self, waves: UnitWaves, rng: np.random.Generator, what: str) -> tuple[_Built, int]:
        """The best assembly that is found, by sums of waves first, then at the load; and the bound by the sums."""
        built = self.built(what, waves.searched(rng, progress=self.progress))
        return self.improved(waves, built, what), waves.bound()

    def improved(self, waves: UnitWaves, built: _Built, what: str) -> _Built:
        """Exchange parts so that more units are within their limits, each exchange solved at the load."""
        waves, residual = self.uncertain(waves, built), self.residual(waves, built, np.arange(len(built.turns)))
        known = dict(zip(built.assembly.names(), self.errors(built.turns).tolist(), strict=True))
        idle = 0  # rounds that brought nothing
        while idle < _IDLE:
            idle += 1
            for place in range(len(waves.parts)):
                old, errors = built.assembly, self.errors(built.turns)
                if (waves.solved.bad(errors) < _SURE).all():
                    return built
                new = waves.assigned(old, (place,), residual=residual, known=known)
                changed = np.flatnonzero((new.part != old.part).any(axis=1) | (new.turn != old.turn).any(axis=1))
                if not changed.size:
                    continue
                turns = built.turns.copy()
                turns[changed] = self.solved(what, self.lot.values(new.of(changed)))
                true = self.errors(turns)[changed]
                known |= dict(zip(new.of(changed).names(), true.tolist(), strict=True))
                difference = (true - waves.errors(waves.whole(new, residual)[changed]))[np.isfinite(true)]
                if difference.size >= _KNOWN:  # what parts are taken out of is known by now, so the doubt is less
                    waves = replace(waves, doubt=max(float(difference.std()), 1e-3))
                gain = waves.solved.cost(errors) - waves.solved.cost(self.errors(turns))
                circle = _circles(old.part[:, place], new.part[:, place])
                better = (np.bincount(circle, gain) > 1e-3)[circle]
                built = _Built(old.with_some(new, better), np.where(better[:, None], turns, built.turns))
                moved = changed[better[changed]]
                if moved.size:
                    residual[moved] = self.residual(waves, built, moved)
                    idle = 0
        return built

    def residual(self, waves: UnitWaves, built: _Built, rows: Integers) -> Array:
        """Difference of the true waves of some units from the sums of their parts' waves, scaled to the true size."""
        some = built.assembly.of(rows)
        whole, true = waves.whole(some), self.units.waves(self.lot.values(some))[0]
        scale = built.turns[rows] / self.units.allowed / section_sizes(true, self.units.sections).T
        difference = true * np.repeat(scale, [at.stop - at.start for at, _ in self.units.sections], axis=1) - whole
        return np.where(np.isfinite(difference), difference, 0.0).astype(np.float32)

    def in_classes(self, waves: UnitWaves, rng: np.random.Generator) -> Assembly:
        """Parts sorted by their main size into three classes of equal number, put together class with class.

        The main size is the one that does most at the output.
        """
        count = waves.most
        edges = [round(count * k / _CLASSES) for k in range(_CLASSES + 1)]
        found = waves.shuffled(rng)
        for pool in waves.sizes:
            places = [place for place, of in enumerate(self.lot.pools) if of == pool]
            kits = places[0] >= len(self.lot.parts)  # as they come
            sizes = np.zeros(waves.sizes[pool]) if kits else self.main_sizes(places[0])
            chosen = found.part[:, places].ravel()
            chosen = chosen[np.argsort(sizes[chosen], kind="stable")]
            for first, last in pairwise(edges):
                some = rng.permutation(chosen[first * len(places) : last * len(places)])
                found.part[first:last, places] = some.reshape(-1, len(places))
        return found

    def main_sizes(self, place: int) -> Array:
        """Of the parts for a place the size that does most at the output."""
        sizes, moved = self.lot.columns.sizes[place], self.lot.columns.moved[place][0]
        effect = sizes.std(axis=0) * (moved @ self.slope).std(axis=1)
        return sizes[:, effect.argmax()] if effect.size else np.zeros(len(sizes))

    def of_one_size(self, assembly: Assembly) -> Integers:
        """Rollers of each unit where their kits are made in the order of size: of one class, or of two that adjoin."""
        kits = self.lot.kits
        ordered = kits.ravel()[np.argsort(self.main_sizes(len(self.lot.parts))[kits.ravel()], kind="stable")]
        return np.asarray(ordered.reshape(kits.shape)[assembly.part[:, -1]])

    def placed(self, waves: UnitWaves, built: _Built) -> _Built:
        """Rollers of each unit in the grooves where its error is least, solved at the load; as they came where not."""
        grooves = np.array([self.lot.groove(n, self.slope) for n in range(self.lot.reducer.pins)])
        came = self.lot.in_grooves(built.assembly)
        whole = waves.whole(built.assembly, self.residual(waves, built, np.arange(len(came))))
        rollers = np.array([placed(waves, grooves, row, wave) for row, wave in zip(came, whole, strict=True)])
        found = self.built("units with rollers placed", built.assembly, rollers)
        better = (self.errors(found.turns) < self.errors(built.turns))[:, None]
        return _Built(built.assembly, np.where(better, found.turns, built.turns), np.where(better, rollers, came))


def _circles(before: Integers, after: Integers) -> Integers:
    """Units among which parts went round, by a number: what one of them gains another may pay for."""
    at = {int(part): unit for unit, part in enumerate(before)}
    origin = [at.get(int(part), unit) for unit, part in enumerate(after)]
    count = len(before)
    graph = scipy.sparse.coo_matrix((np.ones(count), (np.arange(count), origin)), shape=(count, count))
    return np.asarray(scipy.sparse.csgraph.connected_components(graph, directed=False)[1], dtype=np.intp)


def _result(at_load: _AtLoad, built: _Built, ways: Sequence[WayToBuild], bound: int, doubt: float) -> Matched:
    """Good units by name, and the parts of all others."""
    lot, errors, chances = at_load.lot, ways[-1].errors, ways[-1].chances
    good = (errors <= 1) & (chances >= 0.5)
    quantities, allowed = at_load.units.quantities, at_load.units.allowed
    if not good.any():
        row, best = built.turns[errors.argmin()], errors.min()
        worst = int((row / allowed).argmax())
        known = f", by sizes so uncertain that {chances.max():.0%} is the best chance" if best <= 1 else ""
        raise InputError(
            f"no unit of these parts meets the limits: the best one has {quantities[worst].label} of "
            f"{row[worst] / ARCSEC:.4g} arcsec{known}, and {allowed[worst] / ARCSEC:.4g} are allowed; give a higher "
            "limit"
        )
    grooves = lot.in_grooves(built.assembly) if built.rollers is None else built.rollers
    units: list[MatchedUnit] = []
    for number in np.flatnonzero(good)[np.argsort(errors[good])]:
        parts, effects = [], list(lot.model.effects)
        for at, place in enumerate(lot.places):
            part = lot.parts[at][built.assembly.part[number, at]]
            turn = place.turns[built.assembly.turn[number, at]]
            total = (turn + lot.before[part.serial]) % lot.reducer.cranks if place.kind == "disc" else turn
            parts.append(MountedPart(place.kind, place.number, part.serial, total))
            effects += mounted(part, lot.reducer, place.number, turn)
        for pin, chosen in enumerate(grooves[number]):
            parts.append(MountedPart("roller", pin, lot.rollers[chosen].serial))
            effects += lot.rollers[chosen].at(pin)
        built_so = replace(lot.model, effects=tuple(effects))
        units.append(MatchedUnit(tuple(parts), built_so, tuple(built.turns[number]), float(chances[number])))
    every = Counter({(part.kind, part.serial): part.count for parts in (*lot.parts, lot.rollers) for part in parts})
    rest = every - Counter((part.kind, part.serial) for unit in units for part in unit.parts)
    left = {
        kind: tuple(serial for of, serial in rest.elements() if of == kind)
        for kind in dict.fromkeys(k for k, _ in rest)
    }
    order = [ways[0], *sorted(ways[1:], key=lambda way: (-way.share, way.p95))]
    name = lot.model.name or lot.model.mechanism.name
    return Matched(
        name, quantities, tuple(allowed), tuple(units), left, len(errors), bound, tuple(order), doubt, lot.notes
    )
