"""What everybody may know."""

BOARD = {"stamp_s": None, "moment_nm": 0.0}
