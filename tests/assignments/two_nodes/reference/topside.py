"""At the surface: sends the pilot's sticks, and monitors the link.

page "sticks" comes, 20 times a second --> page "controls", which crosses the link
pages "link_tether", "vehicle" ----------> page "alarm": is the vehicle still there?
"""

from snr_sim import Endpoint, handles

OLD_S = 0.5  # from here on what the vehicle said last is old


class Topside(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.last_state = ""

    @handles("sticks")
    def on_sticks(self, sticks):
        state = self.link_state()
        if state != self.last_state:
            print(f"{self.get_time_s():6.2f} s  link: {state}")
            self.last_state = state
        return [self.store_data_task("controls", sticks), self.store_data_task("alarm", {"state": state})]

    def link_state(self):
        """Return "ok", "old" or "lost"."""
        link = self.get_data("link_tether")
        if link is None or not link["up"]:
            return "lost"
        if self.get_data("vehicle") is None or self.get_age_s("vehicle") > OLD_S:
            return "old"
        return "ok"
