"""Judge what ``rverror allocate --at`` claims: python -m benchmarks.load_trial [--first K] [--lists N] [--units 2000].

For the shipped list, other lists of examples/ and random ones: least cost by the command line, then units drawn from
the saved list and solved by the equilibrium of this folder.  Printed is, for each limit, the yield found here and
whether it lies in the printed interval; at the end the share of limits whose yield does.  An interval is of the
printed yield alone: the own yield has a spread of its own (0.2 % at 99 % of 2000 units), told beside it, so a few in
a hundred may lie outside a true interval; one that is far outside, or a claim above 3 spreads of the own, is wrong.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.load_trial import judging
from benchmarks.load_trial.lists import Case, random_case

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def shipped() -> Iterator[Case]:
    """Lists of examples/ for the RV-40E; one is asked for the maker's figures, the stiffness within 10 %."""
    for path in sorted(EXAMPLES.glob("rv40e*-tolerances.toml")):
        model = EXAMPLES / f"{path.stem.removesuffix('-tolerances')}.toml"
        if model.stem == "rv40e-maker":
            yield Case(path.stem, model, path, "60 arcsec", (20.0, 412.0), "60 arcsec", "97.2 N*m/arcmin")
        else:
            yield Case(path.stem, model, path, "30 arcsec", (20.0, 412.0))


def main(words: list[str] | None = None) -> int:
    """Run the trial with these words of the command line; 1 where a claim is wrong or a command failed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0], allow_abbrev=False)
    parser.add_argument("--lists", type=int, default=20, help="random lists")
    parser.add_argument(
        "--first", "--seed", type=int, default=0, help="seed of the first random list; its units have others"
    )
    parser.add_argument("--units", type=int, default=2000, help="of each list, solved here")
    parser.add_argument("--folder", type=Path, help="keep the files here")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--no-examples", action="store_true", help="random lists only")
    which.add_argument("--only-examples", action="store_true", help="no random lists")
    parser.add_argument("--make", action="store_true", help="write the random lists and stop")
    given, more = parser.parse_known_args(words)  # what is not known here goes to allocate
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.folder or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        cases = [] if given.no_examples or given.make else list(shipped())
        seeds = range(given.first, given.first + (0 if given.only_examples else given.lists))
        if given.make:
            for seed in seeds:
                case = random_case(seed, folder)
                print(case.model, case.tolerances, *(f'"{word}"' for word in case.options()), flush=True)
            return 0
        verdicts, failed = [], 0
        for number in range(len(cases) + len(seeds)):
            if number < len(cases):
                case, seed = cases[number], 760_000 + number
            else:
                seed = seeds[number - len(cases)]
                case, seed = random_case(seed, folder), 770_000 + seed
            report, saved, seconds, told = judging.run(case, folder, more)
            print(f"\n{case.name}: {' '.join(case.options())}", flush=True)
            if report is None:
                failed += 1
                print(f"  no result after {seconds:.0f} s, {told}", flush=True)
                continue
            print(f"  cost {report.get('cost_before')} -> {report.get('cost')} in {seconds:.0f} s, {told}")
            start = time.perf_counter()
            try:
                judge = judging.Judge(case.model, saved, given.units, seed)
                for verdict in judge.judge(report):
                    verdicts.append(verdict)
                    print(verdict.line(), flush=True)
            except (ValueError, KeyError, ArithmeticError) as error:
                failed += 1
                print(f"  not judged: {error}", flush=True)
            print(f"  judged in {time.perf_counter() - start:.0f} s", flush=True)
    held = sum(verdict.held for verdict in verdicts)
    wrong = sum(verdict.distance > 3 for verdict in verdicts)
    print(
        f"\n{held} of {len(verdicts)} limits held; {wrong} more than 3 spreads outside; {failed} lists without result"
    )
    return int(bool(wrong or failed or not verdicts))


if __name__ == "__main__":
    raise SystemExit(main())
