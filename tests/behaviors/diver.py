"""A program that dives and rises, and the depths that it reads meanwhile."""

DEPTHS = [{"depth_m": 0.1 * (i % 20)} for i in range(60)]
DIVER = """(var push := [5])
(machine diver
  (event deep [robot.depth.read() is not None and robot.depth.read() > 1.0])
  (event halt)
  (state sinking (onentry [robot.up.start(0)]))
  (state rising (onentry [robot.up.start(push)]) (onexit [log(f"rose with {push}")]))
  (on deep sinking -> rising)
  (on halt * -> sinking)
  (ontime 300 rising -> sinking))
(spawn diver sinking)
"""
