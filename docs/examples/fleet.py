"""Many logs of two aircraft: three questions to their tables, in SQL (pip install duckdb).

python docs/examples/fleet.py FOLDER
"""

import sys
from pathlib import Path

import duckdb
import numpy as np

from bfi_cli.commands import run_command

folder = Path(sys.argv[1])
time_s = np.arange(0.0, 600.0, 0.25)
rows = ["log,aircraft"]
for k in range(4):
    tas = 90.0 + 3.0 * np.sin(0.05 * time_s) + 0.05 * np.random.default_rng(k).standard_normal(time_s.size)
    if k % 2:  # the second aircraft loses its airspeed now and then
        tas[(time_s > 100.0 * k) & (time_s < 100.0 * k + 3.0)] = 0.0
    table = np.column_stack((time_s, tas, np.full(time_s.size, 2000.0)))
    np.savetxt(folder / f"flight_{k}.csv", table, "%.5g", ",", header="time [s],tas [m/s],altitude [m]", comments="")
    rows.append(f"flight_{k}.csv,{'N2' if k % 2 else 'N1'}")
(folder / "list.csv").write_text("\n".join(rows) + "\n")
run_command(["diagnose", "--list", str(folder / "list.csv"), "--out", str(folder / "fleet"), "--workers", "1"])

for name in ("flights", "events"):  # Parquet where pyarrow is installed, else CSV
    (file,) = (folder / "fleet").glob(f"{name}.*")
    duckdb.sql(f"create table {name} as from '{file}'")
QUESTIONS = {
    "Which aircraft has how many faults in an hour of flight?": "select aircraft, sum(declared) / sum(flight_s) * 3600 "
    "as faults from flights group by aircraft order by faults desc",
    "Which fault comes again, in how many flights?": "select aircraft, fault, count(distinct log) as flights "
    "from events where state = 'declared' group by all order by flights desc",
    "Which flights could tell nothing?": "select log from flights where decision = 'inconclusive' order by log",
}
for question, sql in QUESTIONS.items():
    print(f"{question}\n{duckdb.sql(sql)}")
