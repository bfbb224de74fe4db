#!/usr/bin/env bash
# svzerod 3.2 (svZeroDSolver): with use_cycle_to_cycle_error the solver runs on until its cycles repeat, then returns the
# cycle from before that. With an RCR outlet it replaces the number of cycles asked for, here 40 by 1.
# Pulsatile flow of 66.8 ml/s on average into a compliance of 3 ml/mmHg and a resistance of 1 mmHg s/ml, 1 s a beat.
# The mean pressure must be 66.8 mmHg, by the law of the resistance alone. Tolerance 1 % (the default), default start:
#   - 3 cycles asked, "Ran simulation for 5 more cycles to converge": returned is cycle 3 with 59.3 mmHg, not cycle 8
#     with 65.4. The tighter the tolerance, the more cycles are run, and the answer stays 59.3;
#   - 2 cycles asked (the least allowed): 56.3 mmHg in the first 101 rows, then one more row at 0 s for each added cycle;
#   - RCR outlet (same total resistance, 0.2 ml/mmHg), 40 cycles asked: one is run, 51.7 mmHg, "Percent error ... : 0";
#   - the option left out, 40 cycles: right within 0.1 mmHg in both cases.
# With output_all_cycles the added cycles are there, but the times of each begin again at 0.
# The documentation says that cycles are added until mean pressure and flow repeat, not that these are left out. For RCR
# it says that the number follows from the largest Rd C of the outlets. So compliance of vessels or of a chamber does not
# count, nor does the number asked for.
# Why it matters: such an option is switched on for fits and sweeps, where nobody looks at each run. The pressure is
# plausible and 11 to 23 % low, and the message says that it has converged.
# What to do: leave the option out. Ask for cycles by the largest R C of the whole circuit (5 R C for 1 %), write all
# cycles and compare the last two; check that as much flows out as in.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check svzerod==3.2 numpy==2.4.6 pandas==3.0.6

cat > cycle.py <<'END'
import sys

import numpy as np
import svzerod

BEAT, EJECTION, PEAK = 1.0, 0.35, 300.0  # s, s, ml/s
COMPLIANCE, RESISTANCE = 3.0, 1.0  # ml/mmHg, mmHg s/ml
OUTLETS = {
    "RESISTANCE": {"R": RESISTANCE, "Pd": 0.0},
    "RCR": {"Rp": 0.05, "Rd": RESISTANCE - 0.05, "C": 0.2, "Pd": 0.0},
}


def run(outlet, cycles, **options):
    time = np.linspace(0, BEAT, 101)
    flow = np.where(time < EJECTION, PEAK * np.sin(np.pi * time / EJECTION), 0)
    wall = {"R_poiseuille": 0.0, "C": COMPLIANCE, "L": 0.0, "stenosis_coefficient": 0.0}
    return svzerod.simulate({
        "simulation_parameters": {
            "number_of_cardiac_cycles": cycles, "number_of_time_pts_per_cardiac_cycle": len(time), **options},
        "boundary_conditions": [
            {"bc_name": "IN", "bc_type": "FLOW", "bc_values": {"Q": flow.tolist(), "t": time.tolist()}},
            {"bc_name": "OUT", "bc_type": outlet, "bc_values": OUTLETS[outlet]}],
        "junctions": [],
        "vessels": [{
            "vessel_id": 0, "vessel_name": "chamber", "vessel_length": 1.0, "zero_d_element_type": "BloodVessel",
            "zero_d_element_values": wall, "boundary_conditions": {"inlet": "IN", "outlet": "OUT"}}],
    })


def cycle(one):
    """Mean and first pressure, and mean outflow, of one cycle of 101 rows."""
    means = [((v[1:] + v[:-1]) / 2).mean() for v in (one.pressure_in.values, one.flow_out.values)]
    return means[0], one.pressure_in.iloc[0], means[1]


def closed_form():
    """Mean pressure, and the pressure with which each beat of the repeating state begins."""
    rate, angular = 1 / (RESISTANCE * COMPLIANCE), np.pi / EJECTION
    charge = PEAK / COMPLIANCE * angular * (1 + np.exp(rate * EJECTION)) / (rate**2 + angular**2)
    return RESISTANCE * PEAK * EJECTION * 2 / np.pi / BEAT, charge / (np.exp(rate * BEAT) - 1)


tight = {"use_cycle_to_cycle_error": True, "sim_cycle_to_cycle_percent_error": 0.01}
tables = {
    "RESISTANCE, 40 cycles": run("RESISTANCE", 40),
    "RESISTANCE, 3 cycles": run("RESISTANCE", 3),
    "RESISTANCE, 3 cycles and more until 1 %": run("RESISTANCE", 3, use_cycle_to_cycle_error=True),
    "RESISTANCE, 3 cycles and more until 0.01 %": run("RESISTANCE", 3, **tight),
    "RESISTANCE, 2 cycles and more until 1 %": run("RESISTANCE", 2, use_cycle_to_cycle_error=True),
    "RCR, 40 cycles": run("RCR", 40),
    "RCR, 40 cycles, 1 %": run("RCR", 40, use_cycle_to_cycle_error=True),
    "RCR, 40 cycles, 1 %, all cycles written": run("RCR", 40, use_cycle_to_cycle_error=True, output_all_cycles=True),
}
mean, first = closed_form()
sys.stdout.flush()
print(f"{'':43s} rows   last time, s   mean, mmHg  flow out, ml/s")
print(f"{'closed form (inflow = outflow)':43s} {'':19s} {mean:12.2f} {mean / RESISTANCE:15.2f}")
values = {}
for name, table in tables.items():
    values[name] = cycle(table.iloc[:101])
    print(f"{name:43s} {len(table):4d} {table.time.iloc[-1]:14.2f} {values[name][0]:12.2f} {values[name][2]:15.2f}")
long, three, more, tighter, two, rcr, rcr_error, rcr_all = values.values()
print(f"pressure at the start of a beat: closed form {first:.2f}, RESISTANCE with 40 cycles {long[1]:.2f} mmHg")
written = run("RESISTANCE", 3, use_cycle_to_cycle_error=True, output_all_cycles=True)
last = cycle(written.iloc[-101:])
print(f"all cycles written: the last added one has {last[0]:.2f} mmHg; times at the ends of the cycles",
      *written.time.iloc[100::100])
seen = abs(last[0] - 65.4) < 0.3 and written.time.iloc[400::100].eq(BEAT).all()
seen = seen and abs(long[0] - mean) < 0.2 and abs(long[1] - first) < 0.2 and abs(rcr[0] - mean) < 0.2
seen = seen and three == more == tighter and abs(more[0] - 59.3) < 0.3 and two[0] < more[0]
seen = seen and len(tables["RESISTANCE, 2 cycles and more until 1 %"]) > 101
seen = seen and rcr_error == rcr_all and len(tables["RCR, 40 cycles, 1 %, all cycles written"]) == 101
seen = seen and abs(rcr_error[0] - 51.7) < 0.3
print("as described" if seen else "CHANGED: other cycles returned")
sys.exit(not seen)
END
venv/bin/python cycle.py
