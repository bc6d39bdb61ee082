"""The air: what receivers hear. Nothing is said twice here: what a radio repeats is made when somebody asks for it."""

from judge.carriers import Advertisement, Beacon
from judge.receptions import Reception, Run, from_advertisement, from_beacon

from .world import START_US


class Air:
    """loss: the share of packets that the receiver doesn't hear, independently of each other."""

    def __init__(self, world, loss=0.0):
        self.world, self.loss = world, loss
        self.receptions = []
        self.radios = []  # call(us): whatever they have sent until then

    def advertisement(self, address, data, extended):
        """What a receiver makes of it; None: no Remote ID."""
        event, phy = ("extended nonconnectable", "Coded/Coded") if extended else ("ADV_NONCONN_IND", "1M")
        text = ":".join(f"{octet:02X}" for octet in reversed(address))
        return from_advertisement(0.0, 0.0, Advertisement(extended, text, "random", event, phy, -60, data), keep=False)

    def beacon(self, bssid, element, channel):
        return from_beacon(0.0, 0.0, Beacon(bssid, element, channel, -60), keep=False)

    def hear(self, what, us):
        """A packet of this content at that instant."""
        if what is None or (self.loss and self.world.chance.random() < self.loss):
            return
        mono = us / 1e6
        self.receptions.append(Reception(
            self.world.unix_s_at(us), mono, what.channel, what.address, what.payload, what.raw, what.phy, what.rssi,
            what.address_type, what.event_type, what.wifi_channel, what.problem))

    def run(self):
        """All that was heard until now, in the order in which it was."""
        for radio in self.radios:
            radio(self.world.now_us)
        self.receptions.sort(key=lambda reception: reception.mono)
        return Run(self.receptions, START_US / 1e6, self.world.now_us / 1e6, ["the simulated world"])
