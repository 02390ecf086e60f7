"""Sessions: when they were measured, what their runs tell, and how much of it is noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rverror
from rverror.life.sessions import Session, bumps, history_of, repeated, run_files, sessions_of

UNIT = rverror.Model(rverror.reducer("RV-40E"))
N = 512
THETA = 2 * np.pi * np.arange(N) / N
NOISE = 0.3 * rverror.ARCSEC


def run(error: np.ndarray, way: float = 1.0, index: str = "A", **metadata: str) -> rverror.Run:
    theta = THETA if way > 0 else THETA[::-1]
    return rverror.run_from_arrays(
        input_angle=121 * theta, te=error if way > 0 else error[::-1], direction=way, torque="20 N*m", index=index,
        metadata=metadata,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("heads", "unit", "times"),
    [
        ([{"hours": "100"}, {"hours": "2 d"}, {"hours": "100"}], "hour", [48.0, 100.0]),
        ([{"cycles": "2e5"}, {"cycles": "1e5"}], "cycle", [1e5, 2e5]),
        ([{"date": "2026-03-02"}, {"date": "2026-03-01T12:00"}], "hour", [0.0, 12.0]),
        ([{"Hours": "3", "date": "2026-03-02"}, {"hours": "1", "cycles": "7"}], "hour", [1.0, 3.0]),
    ],
)
def test_runs_of_one_time_are_a_session(heads: list[dict[str, str]], unit: str, times: list[float]) -> None:
    found = sessions_of(run(0 * THETA, **head) for head in heads)
    assert found[0] == unit
    assert [one.at for one in found[1]] == times
    assert sum(len(one.runs) for one in found[1]) == len(heads)


@pytest.mark.parametrize(
    ("heads", "said"),
    [
        ([{"hours": "1"}, {}], "does not say when"),
        ([{"hours": "1"}, {"date": "2026-03-01"}], "does not say when"),
        ([{"hours": "soon"}], "hours = 'soon' cannot be read"),
        ([{"hours": "-1"}], "must be 0 or more"),
        ([{"date": "1.3.2026"}], "write '2026-03-01'"),
    ],
)
def test_a_time_that_cannot_be_read_is_said(heads: list[dict[str, str]], said: str) -> None:
    with pytest.raises(rverror.InputError, match=said):
        sessions_of(run(0 * THETA, **head) for head in heads)


def history(changes: np.ndarray, *, lost: np.ndarray | None = None, zero: bool = True):  # type: ignore[no-untyped-def]
    """Sessions whose order 40 has a size each, lost motions, and zeros of the bench that mean nothing."""
    random = np.random.default_rng(5)
    sessions = []
    for number, size in enumerate(changes):
        offset = random.normal(0, 1e-3)
        play = 0.0 if lost is None else lost[number]
        runs = tuple(
            run(
                size * np.cos(40 * THETA) + offset + way * play / 2 + random.normal(0, NOISE, N),
                way,
                f"zero {number}" if zero else "",
            )
            for way in (1.0, -1.0)
        )
        sessions.append(Session(100.0 * number, str(number), runs))
    return history_of(UNIT, sessions)


def test_noise_is_that_of_a_session_whatever_grows_or_jumps() -> None:
    """White noise of sigma leaves each amplitude, over the root of two, a variance of sigma^2 / n."""
    true = NOISE**2 / N
    for size in (np.zeros(12), 1e-3 * np.arange(12), np.where(np.arange(12) < 6, 0, 1e-3)):
        found = history(size)
        waves = found.variance[: len(found.variance) - found.own_zeros]
        assert np.median(waves) / true == pytest.approx(1, rel=0.15)
    two = history(np.array([0.0, 1e-3]))
    assert np.median(two.variance[: len(two.variance) - two.own_zeros]) / true == pytest.approx(1, rel=0.4)


def test_lost_motion_is_told_where_a_session_has_one_zero() -> None:
    true = np.linspace(50, 60, 8) * rverror.ARCSEC
    found = history(np.zeros(8), lost=true)
    (at,) = found.lost_motion
    # forward less reverse: the zero of a session is in neither
    error = np.sqrt(2 * NOISE**2 / N)
    assert np.abs(found.amplitudes.values @ found.rows[at] - true).max() < 4 * error
    # not below that of the noise; by chance the scatter of eight sessions may say more
    assert 0.8 < found.variance[at] / error**2 < 3
    assert 0.8 < history(np.zeros(4), lost=true[:4]).variance[at] / error**2 < 1.25
    assert history(np.zeros(4), lost=true[:4], zero=False).lost_motion == ()


def test_several_torques_of_one_zero_tell_what_they_wind_up() -> None:
    sessions = []
    for number in range(4):
        runs = [
            replace(run(np.full(N, rverror.ARCSEC * (5 * way + torque + number)), way), torque=torque * 1e3)
            for torque in (20.0, 100.0)
            for way in (1.0, -1.0)
        ]
        sessions.append(Session(float(number), str(number), tuple(runs)))
    found = history_of(UNIT, sessions)
    told = found.amplitudes.values @ found.rows[-found.own_zeros :].T / rverror.ARCSEC
    # 10 between the directions of each torque, 80 between the means of the torques; nothing of the session's number
    assert np.sort(told, axis=1) == pytest.approx(np.tile([10.0, 10.0, 80.0], (4, 1)), abs=1e-6)


def test_a_growth_at_odd_times_is_no_scatter() -> None:
    at = np.array([0.0, 3, 4, 10, 11, 30])
    assert np.abs(bumps(2 + 5 * at, at)).max() < 1e-9
    random = np.random.default_rng(2).normal(0, 3, (200, 6))
    assert bumps(random.T, at).var() == pytest.approx(9, rel=0.15)
    assert not repeated(random.T[:4], at[:4]).any()
    assert repeated(random, np.cumsum(np.arange(200.0) % 3 + 1)).mean() == pytest.approx(9, rel=0.2)


def test_files_of_folders_and_their_subfolders(tmp_path) -> None:  # type: ignore[no-untyped-def]
    for name in ("b/2.csv", "a.csv", "b/.hidden/3.csv", "b/notes.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True, parents=True)
        (tmp_path / name).write_text("x")
    found = run_files([str(tmp_path)], (".csv",))
    assert [path[len(str(tmp_path)) + 1 :] for path in found] == ["a.csv", "b/2.csv"]
    with pytest.raises(rverror.InputError, match="given twice"):
        run_files([str(tmp_path), str(tmp_path / "a.csv")], (".csv",))
    with pytest.raises(rverror.InputError, match="holds no run"):
        run_files([str(tmp_path / "b" / ".hidden")], (".dat",))
