#!/usr/bin/env python3
"""Variance shares of K2 by a response surface: analysis.py DIR, a folder of `flexspline sweep --vary` with two fields, whose ranges are below.

pip install pandas SALib scikit-learn
"""

import pathlib
import sys

import pandas
import SALib.analyze.sobol
import SALib.sample.sobol
from sklearn.gaussian_process import GaussianProcessRegressor

folder = pathlib.Path(sys.argv[1])
plan = pandas.read_csv(folder / "plan.csv", index_col="variant")
files = (folder / "results").glob("*.csv")
rows = pandas.concat(map(pandas.read_csv, files)).set_index("variant")
done = rows[rows.status == "converged"]
surface = GaussianProcessRegressor(normalize_y=True).fit(plan.loc[done.index], done.k2_n_m_per_rad)
problem = {"num_vars": 2, "names": list(plan), "bounds": [[1.0, 1.4], [0.48, 0.5]]}
points = SALib.sample.sobol.sample(problem, 1024)
print(SALib.analyze.sobol.analyze(problem, surface.predict(points))["ST"])
