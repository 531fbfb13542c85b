#!/usr/bin/env python3
"""Which effect is missing? Others' answers to the same question, on the same flights with the same split.

    cargo xtask bench lab --quick --libraries out/libraries
    python3 -m venv venv && venv/bin/pip install -r tests/peers/requirements.txt
    venv/bin/python tests/peers/compare.py out/libraries

Each trial's folder holds the library that quadlab regresses on: the columns of the basic model and of every candidate effect of
the catalogue (derivatives of the residual at zero for effects that are not linear in their coefficients), for training and
held-out flights. So everyone has the same physics, filters and derivatives; what differs is how terms are chosen.

- pysindy STLSQ: sparse regression of each axis on the whole library, columns scaled to unit variance; the threshold is the one with
  the least error on the held-out flights.
- pysindy ensemble: the same by EnsembleOptimizer with bagging; a term is in when it is in at least 60 % of the models.
- stepwise: forward regression from the basic model on raw p-values (ordinary least squares, all axes stacked in units of their
  noise): the effect with the smallest p joins while it is under 0.05.

A finding is a candidate effect with a term in the chosen model; first is the one without which the held-out error is worst (for
stepwise: that which joined first). A trial is right when the first is what was hidden, or when nothing was hidden and nothing is found.
"""

import argparse
import json
import os
import pathlib
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor

# A process a core, each with one thread: threads of linear algebra in every process would wait for each other most of the time.
for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(threads, "1")

import numpy as np
import pysindy
from scipy import stats

warnings.filterwarnings("ignore")

THRESHOLDS = np.logspace(-3, 0, 13)
ENSEMBLE_MODELS = 20
ENSEMBLE_SHARE = 0.6
STEPWISE_P = 0.05
# A column is part of an axis' library when it moves there at all.
DEAD = 1e-12


class Library:
    """One trial: for each axis the target and the columns, on training and on held-out rows."""

    def __init__(self, folder):
        about = json.loads((folder / "library.json").read_text())
        self.hidden = about["hidden"]
        self.group = about["group"]
        self.ours = about["found"]
        self.coefficients = about["coefficients"]
        values = np.fromfile(folder / "library.f64", dtype="<f8")
        at = 0
        parts = {"train": [[] for _ in range(6)], "validate": [[] for _ in range(6)]}
        for flight in about["flights"]:
            rows = flight["rows"]
            for axis in range(6):
                width = 1 + len(about["columns"][axis])
                block = values[at : at + rows * width].reshape(width, rows).T
                at += rows * width
                parts[flight["role"]][axis].append(block)
        if at != len(values):
            sys.exit(f"{folder}: library.f64 holds {len(values)} numbers, {at} were expected")
        self.columns = about["columns"]
        self.train = [np.vstack(p) for p in parts["train"]]
        self.held_out = [np.vstack(p) for p in parts["validate"]]

    def effect(self, column):
        return self.coefficients[column]["effect"]

    def is_basic(self, column):
        return self.coefficients[column]["basic"]


def scaled(library, axis):
    """Columns of unit variance that move, the centred target in units of its own, and the same for held-out rows."""
    train, held_out = library.train[axis], library.held_out[axis]
    x, y = train[:, 1:], train[:, 0]
    size = np.sqrt(np.mean(x * x, axis=0))
    alive = size > DEAD
    x, held = x[:, alive] / size[alive], held_out[:, 1:][:, alive] / size[alive]
    unit = np.std(y) or 1.0
    columns = [c for c, a in zip(library.columns[axis], alive) if a]
    return x, y / unit, held, held_out[:, 0] / unit, columns


def sindy(library, make_optimizer, keep):
    """Candidate effects that sparse regression keeps, axis by axis, by how much worse the held-out error is without each."""
    worth = {}
    for axis in range(6):
        x, y, held_x, held_y, columns = scaled(library, axis)
        if not columns:
            continue
        best = None
        for threshold in THRESHOLDS:
            optimizer = make_optimizer(threshold)
            optimizer.fit(x, y[:, None])
            coefficients = keep(optimizer)
            error = np.sum((held_y - held_x @ coefficients) ** 2)
            if best is None or error < best[0]:
                best = (error, coefficients != 0.0)
        kept = best[1]

        def error_with(inside):
            fitted = np.linalg.lstsq(x[:, inside], y, rcond=None)[0]
            return np.sum((held_y - held_x[:, inside] @ fitted) ** 2)

        with_all = error_with(kept)
        effects = np.array([library.effect(c) for c in columns])
        candidate = np.array([not library.is_basic(c) for c in columns])
        for effect in set(effects[kept & candidate]):
            without = error_with(kept & (effects != effect))
            gain = 0.5 * len(held_y) * np.log(without / with_all)
            worth[effect] = worth.get(effect, 0.0) + gain
    return sorted(worth, key=worth.get, reverse=True)


def stlsq(library):
    return sindy(
        library, lambda t: pysindy.STLSQ(threshold=t, alpha=1e-6, normalize_columns=False), lambda o: o.coef_[0]
    )


def ensemble(library):
    def optimizer(threshold):
        one = pysindy.STLSQ(threshold=threshold, alpha=1e-6, normalize_columns=False)
        return pysindy.EnsembleOptimizer(one, bagging=True, n_models=ENSEMBLE_MODELS)

    def keep(fitted):
        all_models = np.array([np.ravel(c) for c in fitted.coef_list])
        inside = np.mean(all_models != 0.0, axis=0) >= ENSEMBLE_SHARE
        return np.where(inside, np.median(all_models, axis=0), 0.0)

    return sindy(library, optimizer, keep)


def stacked(library):
    """All axes under each other in units of the basic model's residual; a coefficient is one column."""
    width = len(library.coefficients)
    blocks, targets = [], []
    for axis in range(6):
        train = library.train[axis]
        x = np.zeros((len(train), width))
        x[:, library.columns[axis]] = train[:, 1:]
        y = train[:, 0]
        basic = [c for c in library.columns[axis] if library.is_basic(c)]
        left = y - x[:, basic] @ np.linalg.lstsq(x[:, basic], y, rcond=None)[0]
        sigma = np.std(left) or 1.0
        blocks.append(x / sigma)
        targets.append(y / sigma)
    return np.vstack(blocks), np.concatenate(targets)


def stepwise(library):
    """Forward selection of effects by the F test of ordinary least squares, as printed by any package."""
    x, y = stacked(library)
    size = np.sqrt(np.sum(x * x, axis=0))
    x = x / np.where(size > DEAD, size, 1.0)
    alive = size > DEAD
    chosen = [c for c in range(x.shape[1]) if library.is_basic(c) and alive[c]]
    effects = {}
    for c in range(x.shape[1]):
        if not library.is_basic(c) and alive[c]:
            effects.setdefault(library.effect(c), []).append(c)

    def squares(columns):
        fitted = np.linalg.lstsq(x[:, columns], y, rcond=None)[0]
        return np.sum((y - x[:, columns] @ fitted) ** 2)

    found, before = [], squares(chosen)
    while effects:
        tests = []
        for effect, columns in effects.items():
            after = squares(chosen + columns)
            freedom = len(y) - len(chosen) - len(columns)
            f = (before - after) / len(columns) / (after / freedom)
            tests.append((stats.f.sf(f, len(columns), freedom), -f, effect, after))
        p, _, effect, after = min(tests)
        if p >= STEPWISE_P:
            break
        found.append(effect)
        chosen += effects.pop(effect)
        before = after
    return found


METHODS = {"pysindy STLSQ": stlsq, "pysindy ensemble": ensemble, "stepwise p < 0.05": stepwise}


def answers(folder):
    np.random.seed(1)
    library = Library(folder)
    found = {"quadlab": library.ours}
    for name, method in METHODS.items():
        found[name] = method(library)
    return {"trial": folder.name, "group": library.group, "hidden": library.hidden, "found": found}


def count(results, name):
    """Top-1 rate where one effect was hidden, trials with a false finding where nothing was, mean number of wrong findings."""
    single = [r for r in results if len(r["hidden"]) == 1 and r["group"] == "single"]
    pairs = [r for r in results if r["group"] == "pair"]
    nothing = [r for r in results if not r["hidden"] and r["group"] == "nothing"]
    outside = [r for r in results if r["group"] == "outside"]
    first = sum(r["found"][name][:1] == r["hidden"] for r in single)
    both = sum(set(r["hidden"]) <= set(r["found"][name]) for r in pairs)
    false = sum(bool(r["found"][name]) for r in nothing)
    wrong_name = sum(bool(r["found"][name]) for r in outside)
    wrong = sum(len(set(r["found"][name]) - set(r["hidden"])) for r in results)
    return {
        "first": [first, len(single)],
        "both": [both, len(pairs)],
        "false_findings": [false, len(nothing)],
        "named_though_outside": [wrong_name, len(outside)],
        "wrong_findings_a_trial": wrong / max(len(results), 1),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path, help="what `cargo xtask bench lab --libraries DIR` wrote")
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    parser.add_argument("--jobs", type=int, default=None, help="processes; default one a core")
    options = parser.parse_args()
    folders = sorted(p.parent for p in options.folder.glob("*/library.json"))
    if not folders:
        sys.exit(f"{options.folder}: holds no libraries; write some with `cargo xtask bench lab --libraries {options.folder}`")
    with ProcessPoolExecutor(options.jobs) as pool:
        results = []
        for result in pool.map(answers, folders):
            results.append(result)
            if sys.stderr.isatty():
                print(f"\r{len(results)} of {len(folders)} trials", end="", file=sys.stderr, flush=True)
    if sys.stderr.isatty():
        print(file=sys.stderr)
    counts = {name: count(results, name) for name in ["quadlab", *METHODS]}
    if options.json:
        print(json.dumps({"counts": counts, "trials": results}, indent=1))
        return
    print(f"{'':20}{'first':>12}{'both of a pair':>16}{'false findings':>16}{'outside named':>15}{'wrong a trial':>15}")
    for name, c in counts.items():
        part = lambda key: f"{c[key][0]}/{c[key][1]}"
        print(
            f"{name:20}{part('first'):>12}{part('both'):>16}{part('false_findings'):>16}"
            f"{part('named_though_outside'):>15}{c['wrong_findings_a_trial']:>15.2f}"
        )


if __name__ == "__main__":
    main()
