"""Wrong solutions of the lab "depth hold", their lost points and their hints."""

from tests.assignments.mistakes import Mistake, replace

MISTAKES = {
    "sign_error": Mistake(
        "Pushes down when the vehicle is too deep.",
        lost={"direction": 10, "holds": 30},
        hint="pushes in the wrong direction",
        changes=[replace("depth_hold.py", "depth_m - goal_m", "goal_m - depth_m")],
    ),
    "centimetres": Mistake(
        "Computes the error in centimetres.",
        lost={"proportional": 10},
        hint="is the error in centimetres?",
        changes=[replace("depth_hold.py", "depth_m - goal_m", "100 * (depth_m - goal_m)")],
    ),
    "newtons_as_kgf": Mistake(
        "Passes newtons to the thruster curve, which takes kgf.",
        lost={"pulses": 20, "holds": 30},
        hint="gets newtons: 1 kgf is 9.80665 N",
        changes=[
            replace("depth_hold.py", "(sign * up_n / len(VERTICAL) / NEWTONS_PER_KGF)", "(sign * up_n / len(VERTICAL))")
        ],
    ),
    "not_shared": Mistake(
        "Each of the four thrusters gives the whole force.",
        lost={"pulses": 20, "holds": 30},
        hint="divide it by four",
        changes=[
            replace(
                "depth_hold.py", "(sign * up_n / len(VERTICAL) / NEWTONS_PER_KGF)", "(sign * up_n / NEWTONS_PER_KGF)"
            )
        ],
    ),
    "same_way": Mistake(
        "Runs all four thrusters the same way, although two are mounted the other way round.",
        lost={"pulses": 20, "holds": 30},
        hint="mounted in reverse",
        changes=[replace("depth_hold.py", "5: -1, 6: -1", "5: +1, 6: +1")],
    ),
    "not_clamped": Mistake(
        "Requests more force than MAX_FORCE_N.",
        lost={"clamp": 10},
        hint="Clamp the force to -MAX_FORCE_N to MAX_FORCE_N",
        changes=[replace("depth_hold.py", "max(-MAX_FORCE_N, min(MAX_FORCE_N, KP_NPM * error_m))", "KP_NPM * error_m")],
    ),
    "forgets_goal": Mistake(
        "Forgets the goal at the next page, whose depth is None.",
        lost={"keeps_goal": 10, "holds": 30},
        hint="It lost its goal",
        changes=[replace("depth_hold.py", ' and controls["depth_m"] is not None:', ":")],
    ),
    "integral_windup": Mistake(
        "Adds up an integral without a limit, in a global.",
        lost={"proportional": 10, "holds": 30},
        hint="summed from call to call",
        changes=[
            replace("depth_hold.py", "KP_NPM = 80.0\n", "KP_NPM = 80.0\nintegral_n = 0.0\n"),
            replace(
                "depth_hold.py",
                "    return max(-MAX_FORCE_N, min(MAX_FORCE_N, KP_NPM * error_m))\n",
                """\
    global integral_n
    integral_n += 2.0 * error_m
    return max(-MAX_FORCE_N, min(MAX_FORCE_N, KP_NPM * error_m + integral_n))
""",
            ),
        ],
    ),
    "pushes_disarmed": Mistake(
        "Pushes without checking whether the vehicle is armed.",
        lost={"disarmed": 5},
        hint="The vehicle is not armed",
        changes=[replace("depth_hold.py", "if is_armed and depth is not None", "if depth is not None")],
    ),
    "only_the_visible": Mistake(
        "Holds 3 m, whatever depth the pilot requests.",
        lost={"direction": 5, "proportional": 10, "keeps_goal": 5, "holds": 30},
        hint="Does the goal enter the error?",
        changes=[replace("depth_hold.py", "depth_m - goal_m", "depth_m - 3.0")],
    ),
}
