"""Units drawn from a tolerance file, as docs/theory/budget.md says what its widths mean.

A width T at capability Cp: normal, sigma = T / (3 Cp); uniform in +-T; triangular in +-T; rayleigh, a vector whose
length exceeds T with 0.27 % at Cp = 1, so sigma = T / (Cp sqrt(-2 ln 0.0027)) of each component; circle and ring.  Of
an index that is left out every instance has a draw of its own.
"""

from __future__ import annotations

import itertools
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from benchmarks.load_trial import grades
from benchmarks.load_trial.kernel import Train
from benchmarks.load_trial.parts import KINDS, Error, limits, size
from scipy.special import ndtr, ndtri

Array = npt.NDArray[np.float64]
_KNOWN = {
    "name", "key", "tolerance", "indices", "parameters", "distribution", "capability", "mean", "correlation", "phase",
    "fixed", "bounds", "cost", "grade", "size", "diameter", "module",
}  # fmt: skip
VECTORS = ("rayleigh", "circle", "ring")


@dataclass(frozen=True)
class Entry:
    """One tolerance: its instances, which parameters it lets vary, and the law of these."""

    key: str
    instances: tuple[dict[str, Any], ...]
    parameters: tuple[int, ...]
    width: float
    means: tuple[float, ...]
    law: str
    capability: float
    correlation: float
    turned: bool

    def draw(self, rng: np.random.Generator, units: int) -> Array:
        """Values, shape (units, instances, parameters of the source), mm or rad."""
        count, varied = len(self.instances), len(self.parameters)
        z = rng.standard_normal((units, count, varied))
        if self.correlation:
            if self.law not in ("normal", "rayleigh"):
                raise ValueError(f"{self.law} with a correlation is not judged here")
            z = math.sqrt(1 - self.correlation) * z
            z += math.sqrt(self.correlation) * rng.standard_normal((units, 1, varied))
        k = 3 * self.capability
        match self.law:
            case "normal":
                s = z / k
            case "truncated_normal":
                s = ndtri(ndtr(-k) + (1 - 2 * ndtr(-k)) * ndtr(z)) / k
            case "rayleigh":
                s = z / (self.capability * math.sqrt(-2 * math.log(0.0027)))
            case "uniform":
                s = rng.uniform(-1, 1, z.shape)
            case "triangular":
                s = rng.triangular(-1, 0, 1, z.shape)
            case "ring" | "circle":
                pair = z.reshape(units, count, varied // 2, 2)
                pair = pair / np.linalg.norm(pair, axis=-1, keepdims=True)
                if self.law == "circle":
                    pair = pair * np.sqrt(rng.uniform(size=pair.shape[:-1]))[..., None]
                s = pair.reshape(z.shape)
            case _:
                raise ValueError(f"the distribution {self.law} is not judged here")
        x = np.array(self.means) + self.width * s
        if self.turned:  # each vector by an angle of its own
            turn = rng.uniform(0, 2 * np.pi, (units, count, varied // 2))
            c, s = np.cos(turn), np.sin(turn)
            a, b = x[..., 0::2].copy(), x[..., 1::2].copy()
            x[..., 0::2], x[..., 1::2] = c * a - s * b, s * a + c * b
        values = np.zeros((units, count, len(KINDS[self.key].parameters)))
        values[:, :, self.parameters] = x
        return values


def read(path: str | Path, train: Train) -> list[Entry]:
    """Read the tolerances of a TOML file.

    Raises
    ------
    ValueError
        If a table holds what is not judged here.
    """
    tables = tomllib.loads(Path(path).read_text(encoding="utf-8"))["tolerance"]
    return [_entry(table, train) for table in tables]


def _entry(table: dict[str, Any], train: Train) -> Entry:
    if unknown := set(table) - _KNOWN:
        raise ValueError(f"{table['key']}: {', '.join(sorted(unknown))} is not judged here")
    if table["key"] not in KINDS:
        raise ValueError(f"{table['key']} is not judged here")
    kind = KINDS[table["key"]]
    names = table.get("parameters", list(kind.parameters))
    pairs = zip(kind.parameters[::2], kind.parameters[1::2], strict=False)
    whole = kind.vector and all((one in names) == (other in names) for one, other in pairs)
    law = table.get("distribution", "rayleigh" if whole else "normal")
    turned = table.get("phase") == "random"
    if (law in VECTORS or turned) and not whole:
        raise ValueError(f"{table['key']}: {law} needs a vector")
    width, middle = (grades.width(table), 0.0) if "grade" in table else limits(table["tolerance"])
    mean = table.get("mean", 0.0)
    means = tuple(middle + size(mean[name] if isinstance(mean, dict) and name in mean else
                                0.0 if isinstance(mean, dict) else mean) for name in names)  # fmt: skip
    return Entry(
        table["key"],
        tuple(_instances(kind.indices, table.get("indices", {}), train)),
        tuple(kind.parameters.index(name) for name in names),
        width,
        means,
        law,
        float(table.get("capability", 1.0)),
        float(table.get("correlation", 0.0)),
        turned,
    )


def _instances(names: tuple[str, ...], given: dict[str, Any], train: Train) -> list[dict[str, Any]]:
    every = {
        "crank": list(range(train.cranks)),
        "disc": list(range(train.discs)),
        "lobe": list(range(train.lobes)),
        "pin": list(range(train.pins)),
        "member": ["sun", "planet"],
    }
    chosen = []
    for name in names:
        value = given[name] if name in given else every[name]
        chosen.append(value if isinstance(value, list) else [value])
    return [dict(zip(names, index, strict=True)) for index in itertools.product(*chosen)]


def draw(entries: list[Entry], units: int, seed: int, beside: list[Error] | None = None) -> list[list[Error]]:
    """Errors of each unit, those of ``beside`` in all of them."""
    rng = np.random.default_rng(seed)
    made: list[list[Error]] = [list(beside or []) for _ in range(units)]
    for entry in entries:
        values = entry.draw(rng, units).tolist()
        for unit, rows in zip(made, values, strict=True):
            unit.extend(Error(entry.key, index, tuple(row)) for index, row in zip(entry.instances, rows, strict=True))
    return made


def middle(entries: list[Entry], beside: list[Error] | None = None) -> list[Error]:
    """Errors of a unit whose every part is at its mean (0 for vectors that are turned at assembly)."""
    made = list(beside or [])
    for entry in entries:
        values = np.zeros(len(KINDS[entry.key].parameters))
        if not entry.turned:
            values[list(entry.parameters)] = entry.means
        made += [Error(entry.key, index, tuple(values.tolist())) for index in entry.instances]
    return made
