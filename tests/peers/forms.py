#!/usr/bin/env python3
"""What does the unknown effect look like? Others' answers on the same residuals.

    cargo xtask bench forms --strength 1 --nothing 3 --libraries out/forms
    python3 -m venv venv && venv/bin/pip install -r tests/peers/requirements.txt
    venv/bin/python tests/peers/forms.py out/forms

Each trial's folder holds what the basic model leaves of each row of training and held-out flights (`rows.csv`), with all measured
quantities and the time, through the filter of the rows. `squares.json` has the mean squares on the held-out flights of the basic model, of
the model with what `quadlab discover` found, and of the same craft without the hidden form. What is taken is the fall of the squares over
that of the form, axes in units of what the craft leaves without it.

- pysindy: STLSQ of each axis on polynomials of the second degree of all quantities, columns scaled; the threshold is the one with the
  least error on the last training flight's rows, which are left out for that.
- gplearn: symbolic regression of each axis, 12 generations of 300.
- boosted trees (scikit-learn): no formula, but about what any function of the quantities could take.

Nobody but quadlab fits the model's own coefficients again, knows units, or says that there is nothing to find: for these, a proposal is
one that takes more than 5 % of the squared residual of the last training flight's rows.
"""

import argparse
import json
import os
import pathlib
import warnings

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(threads, "1")

import numpy as np
import pysindy
from gplearn.genetic import SymbolicRegressor
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

warnings.filterwarnings("ignore")

THRESHOLDS = np.geomspace(0.05, 0.95, 16)
# Rows every 30 ms hold what the filters leave.
STRIDE = 3
PROPOSED = 0.05


class Trial:
    def __init__(self, folder):
        self.name = folder.name
        with open(folder / "rows.csv") as file:
            names = file.readline().strip().split(",")
        rows = np.loadtxt(folder / "rows.csv", delimiter=",", skiprows=1)[::STRIDE]
        train, held_out = rows[rows[:, 0] == 0], rows[rows[:, 0] == 1]
        keep = [k for k in range(1, len(names) - 6) if np.isfinite(rows[:, k]).all() and np.ptp(train[:, k]) > 1e-9]
        # One of those that are the same but for sign and scale, as height and position down.
        alike = np.abs(np.corrcoef(train[:, keep].T)) > 0.999
        keep = [k for i, k in enumerate(keep) if not alike[i, :i].any()]
        self.quantities = [names[k] for k in keep]
        # The last third of the rows is the last training flight.
        cut = 2 * len(train) // 3
        scale = StandardScaler().fit(train[:, keep])
        self.x = [scale.transform(part[:, keep]) for part in (train[:cut], train[cut:], held_out)]
        self.y = [part[:, -6:] for part in (train[:cut], train[cut:], held_out)]
        squares = json.loads((folder / "squares.json").read_text())
        self.floor, self.before, self.after = (np.array(squares[key]) for key in ("floor", "before", "after"))

    def taken(self, after):
        everything = ((self.before - self.floor) / self.floor).sum()
        return 100 * ((self.before - after) / self.floor).sum() / everything

    def judge(self, fit):
        """What a fit of each axis takes of the held-out rows, and whether it would be proposed."""
        after, proposed = [], False
        for axis in range(6):
            y, inner, outer = (part[:, axis] for part in self.y)
            predict = fit(self.x[0], y, self.x[1], inner)
            gain = 1 - ((inner - predict(self.x[1])) ** 2).sum() / (inner**2).sum()
            if gain < PROPOSED:
                after.append(self.before[axis])
                continue
            proposed = True
            left = ((outer - predict(self.x[2])) ** 2).mean() / (outer**2).mean()
            after.append(self.before[axis] * left)
        return self.taken(np.array(after)), proposed


def sparse(x, y, x_inner, y_inner):
    polynomials = PolynomialFeatures(2).fit(x)
    columns = polynomials.transform(x)
    scale = columns.std(axis=0) + 1e-12
    best = None
    for threshold in THRESHOLDS:
        optimizer = pysindy.STLSQ(threshold=threshold * y.std(), alpha=1e-3)
        optimizer.fit(columns / scale, y[:, None])
        weights = np.asarray(optimizer.coef_).ravel() / scale
        error = ((y_inner - polynomials.transform(x_inner) @ weights) ** 2).sum()
        if best is None or error < best[0]:
            best = (error, weights)
    return lambda other: polynomials.transform(other) @ best[1]


def symbolic(x, y, *_):
    spread = y.std() + 1e-12
    # A quarter of the rows: each generation takes all of them 300 times.
    model = SymbolicRegressor(population_size=300, generations=12, parsimony_coefficient=0.002, random_state=1,
                              function_set=("add", "sub", "mul", "div", "abs", "neg", "inv", "max", "min", "sin", "cos"))
    model.fit(x[::4], y[::4] / spread)
    return lambda other: np.nan_to_num(model.predict(other)) * spread


def trees(x, y, *_):
    model = HistGradientBoostingRegressor(max_iter=200, learning_rate=0.05, random_state=1).fit(x, y)
    return model.predict


PEERS = {"pysindy": sparse, "gplearn": symbolic, "boosted trees": trees}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    folders = sorted(path.parent for path in parser.parse_args().folder.glob("*/rows.csv"))
    forms = {name: [] for name in ("quadlab", *PEERS)}
    false = dict.fromkeys(PEERS, 0)
    calm = 0
    for folder in folders:
        if not (folder / "squares.json").exists():
            continue
        trial = Trial(folder)
        nothing = trial.name.startswith(("nothing", "gusts"))
        calm += nothing
        line = [trial.name]
        if not nothing:
            forms["quadlab"].append(trial.taken(trial.after))
            line.append(f"quadlab {forms['quadlab'][-1]:.0f} %")
        for name, fit in PEERS.items():
            taken, proposed = trial.judge(fit)
            if nothing:
                false[name] += proposed
                line.append(f"{name} {'proposes' if proposed else 'nothing'}")
            else:
                forms[name].append(taken)
                line.append(f"{name} {taken:.0f} %")
        print("; ".join(line), flush=True)
    for name, taken in forms.items():
        enough = sum(one >= 80 for one in taken)
        print(f"{name}: at least 80 % in {enough} of {len(taken)}, median {np.median(taken):.0f} %" +
              (f"; proposes in {false[name]} of {calm} with no form" if name in false else ""))


if __name__ == "__main__":
    main()
