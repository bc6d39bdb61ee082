"""Ten hours of flights through random faults. Among the seeds are those that once broke a law: without the Wi-Fi element's
number given back (1, 9, 10, 11), with whose turn it is counted by the grid (each one that is late), with Bluetooth 5's packs
bound to the grid's even slots (7), and with the counters begun anew after a restart (each one that is kept)."""

import pytest

from . import random_flights

FLIGHT_S = 600


@pytest.mark.parametrize("seed", range(1, 61))
def test_the_laws_hold(seed, tmp_path):
    what = random_flights.plan(seed, FLIGHT_S)
    broken, _, _ = random_flights.fly(seed, FLIGHT_S, what, tmp_path / "flight")
    assert broken == [], f"{random_flights.told(what)}\nagain: make simulate SEEDS={seed}"
