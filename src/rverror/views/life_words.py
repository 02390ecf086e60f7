"""What runs over a unit's life say, in sentences for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rverror.base.numbers import brief, count_of
from rverror.base.text import describe
from rverror.base.units import ARCSEC
from rverror.life.result import Changed, RunsCompared, Trend

_LACKING = 0.001  # chance below which what is left is more than noise
_NAMED = 4  # rivals


def trend_verdict(trend: Trend) -> tuple[str, str]:
    """What grows and jumped, and the words of it to be read first."""
    if not trend.changed:
        strong = "Nothing has changed"
        rest = "beyond noise" if trend.chance >= _LACKING else "that a cause explains, yet sessions differ beyond noise"
        return f"{strong} {rest} (chance {brief(trend.chance, 2)})", strong
    grows, jumped = len(trend.growing), len(trend.jumps)
    parts = [f"{count_of(grows, 'cause')} {'grows' if grows == 1 else 'grow'}"] if grows else []
    parts += [count_of(jumped, "jump")] if jumped else []
    strong = " and ".join(parts)
    left = (
        f"what is left between sessions is noise (chance {brief(trend.chance, 2)})"
        if trend.chance >= _LACKING
        else f"more than noise is left between sessions (chance {brief(trend.chance, 2)}): the model lacks something"
    )
    return f"{strong}; {left}", strong


def compared_verdict(found: RunsCompared) -> tuple[str, str]:
    """What differs, and the words of it to be read first."""
    orders = len({one.order for one in found.orders})
    strong = f"{count_of(orders, 'order')} {'differs' if orders == 1 else 'differ'}" if orders else "No order differs"
    return f"{strong} beyond noise of {brief(found.noise / ARCSEC, 2)} arcsec an order", strong


def life_rivals(changed: Sequence[Changed]) -> Iterator[str]:
    """A sentence for each cause that others would replace, and one for each that is of the bench."""
    for one in changed:
        name = describe(one.key, one.indices)
        if one.measuring:
            yield f"{name} is of the measuring chain, not of the unit"
        if one.rivals:
            others = [describe(key, dict(indices)) for key, indices in one.rivals]
            more = f" and {len(others) - _NAMED} more" if len(others) > _NAMED else ""
            yield f"{name} is not told apart from {', '.join(others[:_NAMED])}{more}"


def remaining_words(trend: Trend) -> str:
    """How long the limit is met."""
    left = trend.remaining
    assert left is not None
    name, now, most = left.quantity.replace("_", " "), left.now / ARCSEC, left.limit / ARCSEC
    what = f"{name} {brief(now, 3)} arcsec now, limit {brief(most, 3)}"
    if left.time is None:
        return f"{what}: nothing that grows is known to reach it, so the time that remains is not to be told"
    times = left.time.low, left.time.value, left.time.high
    low, middle, high = ("no end" if math.isinf(t) else brief(float(f"{t:.3g}"), 3) for t in times)
    some = "" if math.isinf(left.time.value) else f"some {middle} "
    longer = left.time.low / (trend.at.max() - trend.at.min())
    beyond = f"; that is {brief(longer, 2)} times as long as was measured, or more" if longer > 1 else ""
    return f"{what}: reached in {some}{trend.unit}s from the last session on (95 %: {low} to {high}){beyond}"
