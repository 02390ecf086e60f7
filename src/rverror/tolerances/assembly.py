"""What assembly can do about given parts: phasing, which puts them where their errors cancel.

Page ``theory/allocation.md``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, permutations, product
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.errors import InputError, check_kind
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import source
from rverror.tolerances.extremes import direct_kernel
from rverror.tolerances.sampling import check_share
from rverror.tolerances.stacking import PAIRS, Stack

Ints = npt.NDArray[np.intp]

#: Arrangements up to which all are computed.
MOST_ARRANGEMENTS = 20_000

_SAME = 1e-9  # relative: p-p's nearer than this are rounding


@dataclass(frozen=True)
class Step:
    """Measured values go to other places, then vectors are turned."""

    origin: Ints  #: (m,); component whose value each component gets
    pairs: Ints  #: (vectors, 2); components of the vectors that are turned
    angles: Array  #: (vectors,); rad, counter-clockwise

    def __call__(self, values: Array) -> Array:
        """Values of the components afterwards, shape (..., m)."""
        moved = values[..., self.origin]
        x, y = moved[..., self.pairs[:, 0]], moved[..., self.pairs[:, 1]]
        cos, sin = np.cos(self.angles), np.sin(self.angles)
        moved[..., self.pairs[:, 0]] = cos * x - sin * y
        moved[..., self.pairs[:, 1]] = sin * x + cos * y
        return moved


@dataclass(frozen=True)
class Move:
    """One way to mount parts."""

    name: str
    steps: tuple[Step, ...]  #: one after another

    def __call__(self, values: Array) -> Array:
        """Values of the components after the move, shape (..., m)."""
        for step in self.steps:
            values = step(values)
        return values


@dataclass(frozen=True)
class Choice:
    """Ways to mount, one of which a builder takes."""

    name: str
    moves: tuple[Move, ...]  #: the first leaves all as it is


@dataclass(frozen=True)
class Phasing:
    """Arrangement of least p-p of one unit's parts."""

    moves: tuple[str, ...]  #: what to do, one move of each choice, in their order
    values: Array  #: (m,); value of each component in that arrangement
    peak_to_peak: float  #: rad; the least of all arrangements
    as_is: float  #: rad; with the parts as they were
    mean: float  #: rad; over all arrangements, one taken at random
    largest: float  #: rad; over all arrangements
    arrangements: int


@dataclass(frozen=True)
class PhasingGain:
    """What phasing brings over many units."""

    random_mean: float  #: rad; mean p-p of units put together at random
    chosen_mean: float  #: rad; the same in the arrangement of least p-p
    gain: float  #: share by which the mean falls
    gain_error: float  #: its standard error
    level: float
    random_quantile: float  #: rad; this quantile of the p-p at random
    chosen_quantile: float  #: rad; and in the arrangement of least p-p
    units: int
    arrangements: int


def exchange(stack: Stack, name: str, keys: Sequence[str], index: str) -> Choice:
    """Choice of which part goes where, all orders of them.

    Parameters
    ----------
    name : str
        What is exchanged, for people: ``"cranks"``.
    keys : sequence of str
        Sources whose errors are on these parts.
    index : str
        Index that counts them: ``"crank"``, ``"disc"``.

    Raises
    ------
    InputError
        If no component fits, or the parts do not have the same components.

    Examples
    --------
    >>> import rverror
    >>> from rverror.tolerances.stacking import stack, tolerance
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> bores = stack(unit, [tolerance("cycloid.disc_bore_position", "5 um")])
    >>> [move.name for move in exchange(bores, "discs", ["cycloid.disc_bore_position"], "disc").moves]
    ['discs as they are', 'discs 1 0']
    """
    meant = _meant(stack, name, keys, {}, index)
    places = sorted({int(stack.components[c].indices[index]) for c in meant})
    moves = []
    for order in permutations(places):
        part_at = dict(zip(places, order, strict=True))
        origin = _origins(stack, name, meant, {index: part_at})
        word = "as they are" if order == tuple(places) else " ".join(map(str, order))
        nothing_turns = Step(origin, np.empty((0, 2), dtype=np.intp), np.empty(0))
        moves.append(Move(f"{name} {word}", (nothing_turns,)))
    return Choice(name, tuple(moves))


def turn(
    stack: Stack,
    name: str,
    keys: Sequence[str],
    *,
    angle: float,
    steps: Iterable[int],
    shifts: Mapping[str, tuple[int, int]] | None = None,
    **where: IndexValue,
) -> Choice:
    """Choice of how far a part is turned, by whole mounting steps, counter-clockwise in the frame in which it is fixed.

    Parameters
    ----------
    name : str
        What is turned, for people: ``"disc 0"``.
    keys : sequence of str
        Sources whose errors turn with it.  Waves (an index ``harmonic``) turn by the harmonic times the angle, x and y
        by the angle, what an index of `shifts` counts goes to another place.
    angle : float
        One step, rad.
    steps : iterable of int
        Which numbers of steps are possible; 0 is added.
    shifts : mapping of str to (int, int), optional
        For an index that counts features around the part: by how many places one step shifts them, and how many there
        are.  ``{"crank": (1, 3)}`` for the bores of a disc.
    **where
        Which part: ``disc=0``.

    Raises
    ------
    InputError
        If no component fits, one does not turn, or a feature comes to a place that the stack does not have.
    """
    shifted = shifts or {}
    meant = _meant(stack, name, keys, where, None)
    vectors = [_vector(stack, name, c, shifted) for c in meant]
    pairs = np.array([pair for pair, _ in filter(None, vectors)], dtype=np.intp).reshape(-1, 2)
    factors = np.array([factor for _, factor in filter(None, vectors)])
    pairs, first = np.unique(pairs, axis=0, return_index=True)
    moves = []
    for step in dict.fromkeys([0, *steps]):
        # the value at a place is that of the feature that comes there
        part_at = {
            index: {place: (place - step * places) % count for place in range(count)}
            for index, (places, count) in shifted.items()
        }
        origin = _origins(stack, name, meant, part_at)
        word = "as it is" if step == 0 else f"turned by {step} step{'s' * (abs(step) != 1)}"
        moves.append(Move(f"{name} {word}", (Step(origin, pairs, factors[first] * angle * step),)))
    return Choice(name, tuple(moves))


def mounting_choices(stack: Stack, reducer: Reducer) -> tuple[Choice, ...]:
    """Choices that a builder of an RV reducer has: which planet, which crank and which disc goes where.

    Parameters
    ----------
    stack : Stack
        Of a model of the reducer; what it tolerances is moved.
    reducer : Reducer

    Returns
    -------
    tuple of Choice
        Those that leave more than one way.

    Raises
    ------
    InputError
        If the stack tolerances some of the parts that change places and not the others, or a single lobe.

    Notes
    -----
    A disc can be mounted turned by s of its bores' pitches and at another place if its lobes then stand where they
    must: place k has its eccentric direction at 2 pi k / discs, so from place p to place q

        lobes s / cranks = (p - q) / discs    (whole turns aside).

    The two discs of an RV-40E, 39 lobes and 2 cranks, are alike and stand half a turn from one another.  With 3 cranks
    they are not alike, and each can be turned.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.reducer("RV-40E")
    >>> cams = rverror.stack(rverror.Model(unit), [rverror.tolerance("crank.eccentricity", "5 um")])
    >>> [choice.name for choice in mounting_choices(cams, unit)]
    ['cranks']
    """
    check_kind("stack", stack, Stack, "make it with stack(model, tolerances)")
    check_kind("reducer", reducer, Reducer, "give reducer('RV-40E') or model.mechanism")
    frames = {key: source(key).frame for key in {component.key for component in stack.components}}
    choices = []
    for frame, name in (("planet", "planets"), ("crank", "cranks")):
        keys = sorted(key for key in frames if frames[key] == frame)
        if keys:
            choices.append(exchange(stack, name, keys, "crank"))
    indexed = {component.key for component in stack.components if "disc" in component.indices}
    keys = sorted(key for key in frames if frames[key] == "disc" and key in indexed)
    if keys:
        choices.append(_disc_choice(stack, reducer, keys))
    return tuple(choice for choice in choices if len(choice.moves) > 1)


def _disc_choice(stack: Stack, reducer: Reducer, keys: Sequence[str]) -> Choice:
    """Which disc goes where, and by how many pitches of its bores each is turned."""
    cranks, discs, lobes = reducer.cranks, reducer.discs, reducer.disc_lobes
    shifts = {"crank": (1, cranks)}
    turned = [
        turn(stack, f"disc {p}", keys, angle=2 * np.pi / cranks, steps=range(cranks), shifts=shifts, disc=p)
        for p in range(discs)
    ]
    moves = []
    for order, move in zip(permutations(range(discs)), exchange(stack, "discs", keys, "disc").moves, strict=True):
        possible = [
            [s for s in range(cranks) if (lobes * s * discs - (p - q) * cranks) % (cranks * discs) == 0]
            for q, p in enumerate(order)
        ]
        for steps in product(*possible):
            # parts are turned where they are, then change places
            parts = [turned[p].moves[s] for p, s in zip(order, steps, strict=True)]
            words = [move.name, *(part.name for part, s in zip(parts, steps, strict=True) if s)]
            moves.append(Move(", ".join(words), tuple(step for part in (*parts, move) for step in part.steps)))
    return Choice("discs", tuple(moves))


def phasing(stack: Stack, choices: Sequence[Choice], values: Any) -> Phasing:
    """Find the arrangement of least p-p of one unit's measured parts, by computing all.

    Parameters
    ----------
    choices : sequence of Choice
        Taken one after another, in this order.
    values : array_like, shape (m,)
        Measured deviation of each component from its mean, core units, parts as they are.

    Raises
    ------
    InputError
        If the values do not fit the stack, or there are more than `MOST_ARRANGEMENTS` arrangements.

    Notes
    -----
    The nominal error of the stack stays as it is: effects that the model declares, and means, belong to places.
    """
    measured = np.asarray(values, dtype=np.float64)
    if measured.shape != (len(stack.entry),) or not np.isfinite(measured).all():
        raise InputError(
            f"values of the shape {measured.shape}; give a finite one for each of {len(stack.entry)} components"
        )
    number = _number(choices)
    sizes = _all_sizes(stack, choices, measured)
    best = int(np.flatnonzero(sizes <= sizes.min() * (1 + _SAME))[0])  # of equal ones that with the fewest changes
    chosen = next(islice(product(*(choice.moves for choice in choices)), best, None))
    for move in chosen:
        measured = move(measured)
    return Phasing(
        tuple(move.name for move in chosen),
        measured,
        float(sizes[best]),
        float(sizes[0]),
        float(sizes.mean()),
        float(sizes.max()),
        number,
    )


def phasing_gain(
    stack: Stack, choices: Sequence[Choice], *, units: int = 256, level: float = 0.99, seed: int = 0
) -> PhasingGain:
    """What phasing brings: p-p of many units in a random arrangement and in the best.

    Parameters
    ----------
    stack : Stack
    choices : sequence of Choice
    units : int
        2 or more.
    level : float
        Quantile to compare, above 0 and below 1.
    seed : int

    Returns
    -------
    PhasingGain

    Raises
    ------
    InputError
        If an argument is out of its bounds, or there are too many arrangements.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.reducer("RV-40E")
    >>> cams = rverror.stack(rverror.Model(unit), [rverror.tolerance("crank.eccentricity", "5 um")])
    >>> found = phasing_gain(cams, mounting_choices(cams, unit), units=16)
    >>> found.arrangements, found.chosen_mean < found.random_mean
    (2, True)
    """
    check_kind("stack", stack, Stack, "make it with stack(model, tolerances)")
    if units < 2:
        raise InputError(f"units = {units}: must be 2 or more")
    check_share("level", level, 0.99)
    number = _number(choices)
    drawn = stack.standard(np.random.default_rng(seed).random((units, stack.dimensions))) * stack.width[stack.entry]
    sizes = np.array([_all_sizes(stack, choices, values) for values in drawn])
    at_random, chosen = sizes.mean(axis=1), sizes.min(axis=1)
    gain = 1 - chosen.mean() / at_random.mean() if at_random.any() else 0.0
    scatter = np.std(chosen - (1 - gain) * at_random, ddof=1) / math.sqrt(units)  # of a ratio of means
    return PhasingGain(
        float(at_random.mean()),
        float(chosen.mean()),
        float(gain),
        float(scatter / at_random.mean()) if at_random.any() else 0.0,
        level,
        float(np.quantile(sizes, level)),
        float(np.quantile(chosen, level)),
        units,
        number,
    )


def _number(choices: Sequence[Choice]) -> int:
    number = math.prod(len(choice.moves) for choice in choices)
    if number > MOST_ARRANGEMENTS:
        counts = " x ".join(f"{len(choice.moves)} ({choice.name})" for choice in choices)
        raise InputError(
            f"{counts} = {number} arrangements, above {MOST_ARRANGEMENTS}; give fewer choices, or fewer steps of one"
        )
    return number


def _all_sizes(stack: Stack, choices: Sequence[Choice], values: Array) -> Array:
    """P-p of all arrangements, the last choice running fastest."""
    arranged = values[None]
    for choice in choices:
        arranged = np.stack([move(arranged) for move in choice.moves], axis=1).reshape(-1, values.size)
    ready = direct_kernel(stack.influence, stack.nominal)
    return ready.extremes(arranged).peak_to_peak


def _meant(
    stack: Stack, name: str, keys: Sequence[str], where: Mapping[str, IndexValue], index: str | None
) -> list[int]:
    """Components that a choice moves."""
    meant = [
        c
        for c, component in enumerate(stack.components)
        if component.key in keys
        and (index is None or index in component.indices)
        and all(component.indices.get(i) == value for i, value in where.items())
    ]
    missing = [key for key in keys if key not in {stack.components[c].key for c in meant}]
    if missing or not meant:
        named = missing[0] if missing else "no source"
        raise InputError(f"{name}: the stack has no such component of {named}; add its tolerance or leave the key out")
    return meant


def _origins(stack: Stack, name: str, meant: Sequence[int], part_at: Mapping[str, Mapping[int, int]]) -> Ints:
    """Component whose value each component gets, where places get other parts."""
    known = {(c.key, frozenset(c.indices.items()), c.parameter): place for place, c in enumerate(stack.components)}
    if len(known) < len(stack.components):
        raise InputError(f"{name}: two tolerances of the stack hold the same component; leave one of them out")
    origin = np.arange(len(stack.components), dtype=np.intp)
    for place in meant:
        component = stack.components[place]
        indices = {
            index: part_at[index][int(value)] if index in part_at else value
            for index, value in component.indices.items()
        }
        wanted = component.key, frozenset(indices.items()), component.parameter
        if wanted not in known:
            listed = ", ".join(f"{i}={v}" for i, v in indices.items())
            raise InputError(
                f"{name}: {component} would get the value of {listed}, which has no tolerance; give it one"
            )
        origin[place] = known[wanted]
    return origin


def _vector(
    stack: Stack, name: str, place: int, shifts: Mapping[str, tuple[int, int]]
) -> tuple[tuple[int, int], int] | None:
    """Vector to which a component belongs and the factor by which it turns; None for a feature that only shifts."""
    component = stack.components[place]
    if any(index in component.indices for index in shifts):
        return None
    mates = next((pair for pair in PAIRS if component.parameter in pair), None)
    turns = component.indices.get("harmonic", 1 if mates == ("x", "y") else None)
    if mates is None or turns is None:
        raise InputError(f"{name}: how {component} turns is not known; say by `shifts` what its index counts")
    rows = {
        c.parameter: row
        for row, c in enumerate(stack.components)
        if (c.key, c.indices) == (component.key, component.indices) and stack.entry[row] == stack.entry[place]
    }
    if not set(mates) <= rows.keys():
        raise InputError(f"{name}: {component} turns with its other component, which has no tolerance; give it one")
    return (rows[mates[0]], rows[mates[1]]), int(turns)
