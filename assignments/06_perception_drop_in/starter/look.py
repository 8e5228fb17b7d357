"""Writes what the camera saw in a run, as a picture: python3 look.py RUN SECOND FILE.png. Do not change it."""

import sys
from pathlib import Path

from PIL import Image

from snr_sim import Page
from snr_sim.prelude.values import decode_value
from snr_sim.recording.folder import trace_path
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import PageRecord

if len(sys.argv) != 4:
    sys.exit("python3 look.py RUN SECOND FILE.png, such as: python3 look.py see_lab/first/* 10 seen.png")
run, second, file = sys.argv[1:]
for record in read_trace(trace_path(Path(run))).records:
    if isinstance(record, PageRecord) and record.name == "camera" and record.t >= float(second):
        picture = Image.fromarray(decode_value(bytes(record.values), {"page": Page})[0].data["rgb"])
        picture.resize((picture.width * 10, picture.height * 10), Image.Resampling.NEAREST).save(file)
        print(f"{file}: what the camera saw at {record.t:.1f} s, ten times as large")
        break
else:
    sys.exit(f"After {second} s there is no picture in {run}.")
