"""Reference solutions and wrong ones stand here, out of the wheel; they run as a student's files, not by themselves."""

collect_ignore = ["sim_to_pi/depth_hold.py"]
collect_ignore_glob = ["*/reference/*", "*/wrong/*"]
