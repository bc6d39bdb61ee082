"""The models with the real daemon between them: is it heard?"""

import patience
from models.flight import write_flight


def test_the_bench_is_heard_on_every_channel(bench, tmp_path):
    write_flight(tmp_path / "flight.tlog", 20)
    one = bench(settings={"self_id": {"description": "bench"}}, flight=tmp_path / "flight.tlog")
    one.air.wait_all_five(("bt4", "bt5", "wifi"))
    for channel in ("bt4", "bt5", "wifi"):
        heard = one.air.receptions(channel)
        assert all(reception.data[0] == 0x0D for reception in heard)
        assert any(b"bench" in reception.data for reception in heard)
    addresses = {reception.address for channel in ("bt4", "bt5") for reception in one.air.receptions(channel)}
    assert len(addresses) == 1
    assert one.daemon.stop() == 0
    patience.wait_for("silence", lambda: one.air.heard("bt4", 1) == [])
