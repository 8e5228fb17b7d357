"""The machine of mission.lrp, as mission.py uses it. Only mission.lrp is yours: change nothing here."""

from pathlib import Path

from snr_sim.behaviors import Bridge, Interpreter, Read, parse

# What mission.lrp reads: robot.is_wet.read(). The two buttons have other names there, as `robot.stop()` is a command.
READS = {"stop_button": "stop", "reset_button": "reset"}
READS |= {name: name for name in ("is_ready", "is_wet", "has_fix", "distance_m", "depth_m")}
BRIDGE = Bridge(reads={name: Read(key) for name, key in READS.items()})
MISSION = parse(Path(__file__).with_name("mission.lrp").read_text(encoding="utf-8"), BRIDGE.parts)


class Machine:
    """What mission.py uses: a state, a gate, and since when."""

    def __init__(self, gates):
        self.known: dict[str, object] = {}
        self.interpreter = Interpreter(MISSION, self.known, bridge=BRIDGE)
        self.interpreter.set("mission.gates", gates)
        self.interpreter.spawn(0)

    @property
    def state(self):
        return self.interpreter.active["mission"]

    @property
    def since_s(self):
        return self.interpreter.since_ns["mission"] / 1e9

    @property
    def gate(self):
        return self.interpreter.variables["mission.gate"]

    def step(self, known):
        """Looks at what is known now, and goes to another state if that is due."""
        self.known.update(known)
        self.interpreter.step(round(known["now_s"] * 1e9))
