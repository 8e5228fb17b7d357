"""A landing on four sprung legs, in space: what MuJoCo computes with other roundings on aarch64 than on x86-64.

python lander.py FOLDER     simulates it, and prints where its trace is
"""

import sys
from pathlib import Path

from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded

trace = Path(sys.argv[1]).absolute() / "lander" / FILE_NAME
trace.parent.mkdir(parents=True, exist_ok=True)
run_recorded(prepare(Request("lander_pad", 0, "mujoco")), trace)
print(trace)
