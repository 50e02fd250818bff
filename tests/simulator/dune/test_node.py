"""What a node sends and to whom."""

import math
import struct
from pathlib import Path
from typing import Any

import imcpy
import numpy as np
import pytest

from imc_bridge import BridgeSettings, SwathPing
from imc_bridge.logs import VehicleLog
from imc_bridge.telemetry.swaths import read_swath
from simulator.dune.transport.contacts import service_addresses
from simulator.dune.transport.rates import RateLimiter, RateLimiterError, parse_limits
from simulator.floors import seafloors
from simulator.sonars.swath import SwathSonar
from simulator.vehicles.battery import BatterySpec
from tests.support.imc.dune_bench import CONSOLE, CONSOLE_ID, Bench, announce, rate_limiters, start_request

OTHER = ("127.0.0.1", 6199)


class TestDiscovery:
    def test_it_announces_itself_every_ten_seconds_to_five_ports(self) -> None:
        bench = Bench()
        bench.run(29.0)
        to = [address for _, address in bench.announced.sent]
        assert sorted(set(to)) == [("127.0.0.1", port) for port in range(30100, 30105)]
        assert len(to) == 5 * 3
        message = bench.announced.sent[0][0]
        assert message.sys_name == "lauv-sim-1"
        assert message.sys_type == imcpy.SystemType.UUV
        assert "imc+udp://127.0.0.1:6002/" in message.services.split(";")

    def test_it_is_silent_before_anyone_is_known(self) -> None:
        bench = Bench()
        bench.run(20.0)
        assert bench.wire.sent == []

    def test_an_announce_alone_is_not_enough(self) -> None:
        bench = Bench()
        bench.node.on_announce(announce().serialize(), CONSOLE)
        bench.run(20.0)
        assert bench.wire.sent == []

    def test_a_packet_without_an_announce_is_not_enough(self) -> None:
        bench = Bench()
        bench.run(20.0, bench.beat)
        assert bench.wire.sent == []
        assert bench.node.counts.strangers == 20

    def test_announced_and_heard_it_sends_within_five_seconds(self) -> None:
        bench = Bench()
        bench.introduce()
        bench.run(5.1, bench.beat)
        assert {to for _, to in bench.wire.sent} == {CONSOLE}
        assert bench.all(imcpy.LogBookEntry)[0].text == "activating transmission to node 'ccu-cao'"

    def test_after_thirty_seconds_of_silence_it_stops_and_the_next_packet_resumes(self, bench: Bench) -> None:
        bench.run(29.0)
        assert bench.all(imcpy.EstimatedState)
        bench.run(10.0)
        bench.wire.sent.clear()
        bench.run(20.0)
        assert bench.wire.sent == []
        bench.beat()
        bench.run(5.0)
        assert bench.all(imcpy.EstimatedState)

    def test_a_system_that_comes_back_at_another_port_stays_ignored(self, bench: Bench) -> None:
        bench.introduce(address=OTHER)
        bench.run(40.0, lambda: bench.say(imcpy.Heartbeat(), address=OTHER))
        assert OTHER not in {to for _, to in bench.wire.sent}
        assert bench.node.contacts.destinations == []

    def test_several_systems_are_served(self, bench: Bench) -> None:
        bench.introduce(0x3F02, OTHER)
        bench.run(6.0, bench.beat)
        assert {to for _, to in bench.wire.sent} == {CONSOLE, OTHER}

    def test_commands_of_strangers_are_dropped(self, bench: Bench) -> None:
        bench.say(start_request(), src=0x3F77, address=OTHER)
        assert bench.states() == (0, 1)

    @pytest.mark.parametrize(
        ("services", "expected"),
        [
            ("imc+udp://10.0.0.1:6001/", {("10.0.0.1", 6001)}),
            ("dune://x/;imc+udp://10.0.0.1:1/;imc+udp://10.0.0.2:2", {("10.0.0.1", 1), ("10.0.0.2", 2)}),
            ("imc+tcp://10.0.0.1:6001/", set()),
            ("imc+udp://10.0.0.1:99999/;imc+udp://:5/;imc+udp://a:b/", set()),
            ("", set()),
        ],
    )
    def test_services_are_read(self, services: str, expected: set[Any] | set[tuple[str, int]]) -> None:
        assert service_addresses(services) == expected


class TestRelay:
    def test_what_is_heard_is_passed_on_to_everyone(self, bench: Bench) -> None:
        bench.introduce(0x3F02, OTHER)
        bench.run(6.0, bench.beat)
        bench.wire.sent.clear()
        bench.beat()
        relayed = [(m, to) for m, to in bench.wire.sent if m.src == CONSOLE_ID]
        assert {type(m) for m, _ in relayed} == {imcpy.Heartbeat}
        assert {to for _, to in relayed} == {CONSOLE, OTHER}

    def test_references_are_not(self, bench: Bench) -> None:
        bench.follow(80, 80)
        assert bench.wire.sent == []


class TestTelemetry:
    def rates(self, bench: Bench, seconds: float = 100.0) -> dict[tuple[str, int], float]:
        bench.wire.sent.clear()
        bench.run(seconds, bench.beat)
        kinds: dict[Any, Any] = {}
        for m, _ in bench.wire.sent:
            if m.src == bench.node.imc_id:
                key = (type(m).__name__, m.src_ent)
                kinds[key] = kinds.get(key, 0) + 1 / seconds
        return kinds

    def test_the_default_rates_are_those_of_dune(self, bench: Bench) -> None:
        rates = self.rates(bench)
        for key, rate in {
            ("EstimatedState", 49): 2.0,
            ("VehicleState", 72): 2.0,
            ("PlanControlState", 51): 3.0,
            ("GpsFix", 60): 1.0,
            ("VehicleMedium", 44): 1.0,
            ("Heartbeat", 0): 1.0,
            ("NavigationUncertainty", 49): 1.0,
            ("SimulatedState", 71): 0.5,
            ("Distance", 58): 0.2,
            ("Distance", 59): 0.2,
        }.items():
            assert rates[key] == pytest.approx(rate, rel=0.06), key

    def test_the_rates_can_be_raised(self, bench: Bench) -> None:
        bench.say(rate_limiters("Distance:5, EstimatedState:10, SimulatedState:0.5"))
        rates = self.rates(bench)
        assert rates[("Distance", 58)] == pytest.approx(5.0, rel=0.02)
        assert rates[("EstimatedState", 49)] == pytest.approx(10.0, rel=0.02)
        assert rates[("SimulatedState", 71)] == pytest.approx(0.5, rel=0.06)

    def test_a_wrong_rate_leaves_everything_as_it_was(self, bench: Bench) -> None:
        bench.say(rate_limiters("Distance:fast"))
        assert self.rates(bench)[("Distance", 58)] == pytest.approx(0.2, rel=0.06)

    def test_the_rates_can_be_asked_for(self, bench: Bench) -> None:
        bench.say(rate_limiters("Distance:5"))
        query = imcpy.QueryEntityParameters()
        query.name = "UDP"
        bench.say(query)
        assert bench.last(imcpy.EntityParameters).params[0].value == "Distance:5"

    def test_chatter_floods(self) -> None:
        bench = Bench(chatter=True).ready()
        rates = self.rates(bench, 10.0)
        assert rates[("ServoPosition", 69)] == pytest.approx(376, rel=0.03)
        assert rates[("EulerAngles", 63)] == pytest.approx(94, rel=0.03)
        loud = ("ServoPosition", "EulerAngles", "AngularVelocity", "Acceleration")
        assert sum(rates.values()) == pytest.approx(710, rel=0.03)
        assert sum(rate for (name, _), rate in rates.items() if name in loud) > 0.9 * sum(rates.values())

    def test_the_loud_messages_are_sent_as_seldom_as_asked(self) -> None:
        bench = Bench(chatter=True).ready()
        bench.say(
            rate_limiters("Distance:5, ServoPosition:0.1, EulerAngles:0.1, AngularVelocity:0.1, Acceleration:0.1")
        )
        rates = self.rates(bench, 10.0)
        assert rates[("ServoPosition", 69)] == pytest.approx(0.1)
        assert rates[("Distance", 58)] == pytest.approx(5.0, rel=0.05)
        # A new list takes the place of the old one: what it leaves out is not limited.
        assert rates[("EstimatedState", 49)] == pytest.approx(10.0, rel=0.05)

    def test_the_state_is_an_origin_and_offsets(self, bench: Bench) -> None:
        bench.run(1.0)
        state = bench.last(imcpy.EstimatedState)
        frame = bench.vehicle.terrain.frame
        assert math.degrees(state.lat) == pytest.approx(frame.lat_deg)
        assert (state.x, state.y) == pytest.approx((20.0, 50.0), abs=1e-3)
        assert state.alt == pytest.approx(bench.vehicle.terrain.max_depth_m, abs=1e-3)

    def test_depth_plus_altimeter_is_the_bottom(self, bench: Bench) -> None:
        bench.say(start_request())
        bench.say(rate_limiters("Distance:5, EstimatedState:10"))
        bench.run(40.0, lambda: bench.follow(50, 150))
        state = {round(m.timestamp, 2): m for m in bench.all(imcpy.EstimatedState)}
        altimeter = [m for m in bench.all(imcpy.Distance) if m.src_ent == 58]
        assert len(altimeter) > 150
        for m in altimeter:
            bottom = state[round(m.timestamp, 2)].depth + m.value
            assert bottom == pytest.approx(bench.vehicle.terrain.max_depth_m, abs=1e-3)
            assert m.location[0].theta == pytest.approx(-math.pi / 2)

    def test_gps_goes_on_under_water_without_validity(self, bench: Bench) -> None:
        bench.run(2.0)
        assert bench.last(imcpy.GpsFix).validity == 511
        bench.say(start_request())
        bench.run(30.0, lambda: bench.follow(50, 150))
        fix = bench.last(imcpy.GpsFix)
        assert (fix.validity, fix.satellites) == (0, 0)
        assert bench.last(imcpy.VehicleMedium).medium == imcpy.VehicleMedium.MediumEnum.UNDERWATER

    def test_it_tells_its_fuel_every_ten_seconds(self) -> None:
        bench = Bench(battery=BatterySpec(level_pct=50.0, confidence_pct=80.0)).ready()
        bench.run(100.0, bench.beat)
        fuel = bench.all(imcpy.FuelLevel)
        assert len(fuel) == pytest.approx(10, abs=1)
        assert fuel[-1].value == pytest.approx(50.0 - 0.3 * 100.0 / 288.0, abs=0.05)
        assert fuel[-1].confidence == 80.0
        hours = dict(mode.split("=") for mode in fuel[-1].opmodes.rstrip(";").split(";"))
        assert float(hours["Motion"]) == pytest.approx(4.0, abs=0.02)
        assert float(hours["Hotel"]) == pytest.approx(4.0 / 0.3, abs=0.05)

    def test_the_entities_are_told_on_request(self, bench: Bench) -> None:
        query = imcpy.EntityList()
        query.op = imcpy.EntityList.OperationEnum.QUERY
        bench.say(query)
        report = bench.last(imcpy.EntityList)
        assert report.dst == CONSOLE_ID
        names = dict(item.split("=") for item in report.list.split(";"))
        assert (names["Altimeter"], names["UDP"], names["Echo Sounder"]) == ("58", "80", "59")
        assert "DVL Beam 0" not in names

    def test_a_dvl_tells_its_four_beams(self) -> None:
        floor = seafloors.generate("slope", 0)
        bench = Bench(floor, "dvl", (50.0, 50.0, 0.0)).ready()
        bench.say(rate_limiters("Distance:5"))
        query = imcpy.EntityList()
        query.op = imcpy.EntityList.OperationEnum.QUERY
        bench.say(query)
        names = dict(item.split("=") for item in bench.last(imcpy.EntityList).list.split(";"))
        bench.run(1.0)
        for k in range(4):
            m = [d for d in bench.all(imcpy.Distance) if d.src_ent == int(names[f"DVL Beam {k}"])][-1]
            device = m.location[0]
            tilt = device.theta + math.pi / 2
            assert math.degrees(tilt) == pytest.approx(22.5, abs=1e-4)
            assert math.degrees(device.psi) == pytest.approx(90 * k, abs=1e-4)
            at = np.array([m.value * math.sin(tilt) * f(device.psi) for f in (math.sin, math.cos)]) + 50.0
            depth = m.value * math.cos(tilt)
            assert float(floor.depth_at(*at)) == pytest.approx(depth, abs=0.01)

    def test_a_multibeam_sends_swaths_at_its_rate(self) -> None:
        bench = Bench(sensor="multibeam", swath=SwathSonar(aperture_deg=100.0, beams=64, rate_hz=2.0)).ready()
        bench.run(10.0)
        sent = bench.all(imcpy.SonarData)
        assert len(sent) == 20
        assert {m.src_ent for m in sent} == {bench.node._entities["Multibeam"]}
        swath = read_swath(sent[-1])
        np.testing.assert_allclose(np.degrees(swath.angles_rad), np.linspace(-50.0, 50.0, 64), atol=1e-3)
        depths = swath.ranges_m * np.cos(swath.angles_rad)
        np.testing.assert_allclose(depths, bench.vehicle.terrain.max_depth_m, rtol=1e-3)
        bench.say(rate_limiters("SonarData:0.5"))
        bench.wire.sent.clear()
        bench.run(10.0)
        assert len(bench.all(imcpy.SonarData)) == 5

    def test_a_multibeams_log_has_every_ping_and_radio_what_it_may(self, tmp_path: Path) -> None:
        bench = Bench(sensor="multibeam", swath=SwathSonar(beams=32), log_dir=tmp_path).ready()
        bench.say(rate_limiters("SonarData:1"))
        bench.wire.sent.clear()
        bench.run(10.0)
        bench.node.stop()
        assert len(bench.all(imcpy.SonarData)) == 10
        (log,) = tmp_path.rglob("Data.lsf*")
        events = list(VehicleLog(log, BridgeSettings()).events())
        pings = [event for event in events if isinstance(event, SwathPing)]
        assert len(pings) >= 50
        assert np.diff([ping.time_s for ping in pings]).max() == pytest.approx(0.2, abs=1e-3)


class TestRobustness:
    def test_rubbish_is_counted_and_survived(self, bench: Bench) -> None:
        good = imcpy.Heartbeat()
        good.src = CONSOLE_ID
        data = good.serialize()
        rubbish = [b"", b"hello", bytes(30), data[:-1], data[:5] + b"\xff" + data[6:], data[:-2] + b"\0\0"]
        before = bench.node.counts.malformed
        for packet in rubbish:
            bench.node.receive(packet, CONSOLE)
        assert bench.node.counts.malformed - before >= 5
        bench.run(1.0)
        assert bench.all(imcpy.EstimatedState)

    def test_unknown_messages_are_skipped(self, bench: Bench) -> None:
        header = struct.pack("<HHHdHBHB", 0xFE54, 60000, 0, 1.0, CONSOLE_ID, 0, bench.node.imc_id, 255)
        bench.node.receive(header + b"\0\0", CONSOLE)
        bench.run(1.0)
        assert bench.all(imcpy.EstimatedState)

    def test_the_id_must_be_possible(self) -> None:
        with pytest.raises(ValueError, match="0xffff"):
            Bench(imc_id=0xFFFF)


class TestRates:
    @pytest.mark.parametrize("rate", [0.2, 0.7, 2.0, 3.0, 5.0, 10.0])
    def test_the_mean_rate_is_kept_on_a_coarse_clock(self, rate: float) -> None:
        limiter = RateLimiter({"Distance": rate})
        passed = sum(limiter.passes("Distance", 1, 0.1 * k) for k in range(10_000))
        assert passed == pytest.approx(1000 * rate, rel=0.02)

    def test_entities_are_limited_one_by_one(self) -> None:
        limiter = RateLimiter({"Distance": 1.0})
        assert limiter.passes("Distance", 1, 0.0)
        assert limiter.passes("Distance", 2, 0.0)
        assert not limiter.passes("Distance", 1, 0.1)

    def test_there_is_no_burst_after_a_gap(self) -> None:
        limiter = RateLimiter({"Distance": 1.0})
        limiter.passes("Distance", 1, 0.0)
        passed = [limiter.passes("Distance", 1, 100.0 + 0.1 * k) for k in range(20)]
        assert sum(passed) <= 3

    def test_limits_are_read(self) -> None:
        assert parse_limits("Distance:5, EstimatedState:10,") == {"Distance": 5.0, "EstimatedState": 10.0}

    @pytest.mark.parametrize("text", ["Distance", "Distance:", "Distance:x", "Distance:0", ":5", "Distance:inf"])
    def test_wrong_limits_are_refused_with_the_form(self, text: str) -> None:
        with pytest.raises(RateLimiterError, match="Message:frequency"):
            parse_limits(text)


class TestFaults:
    def test_a_leak_is_told_every_second_until_it_is_mended_and_after(self, bench: Bench) -> None:
        bench.run(5.0, bench.beat)
        assert bench.all(imcpy.EntityState) == []
        bench.node.fail("leak")
        bench.run(5.0, bench.beat)
        bench.node.mend()
        bench.run(5.0, bench.beat)
        kinds = imcpy.EntityState.StateEnum
        states = [state.state for state in bench.all(imcpy.EntityState)]
        assert (states.count(kinds.FAILURE), states.count(kinds.NORMAL)) == (5, 5)

    def test_in_error_it_takes_no_plan_until_it_is_mended(self, bench: Bench) -> None:
        bench.node.fail("error")
        bench.say(imcpy.Abort())
        bench.run(5.0, bench.beat)
        assert bench.states() == (2, 0)
        state = bench.last(imcpy.VehicleState)
        assert (state.error_ents, state.error_count) == ("Motor", 1)
        bench.say(start_request())
        assert bench.states() == (2, 0)
        bench.node.mend()
        bench.say(start_request())
        assert bench.states() == (3, 3)

    def test_only_what_is_known_can_fail(self, bench: Bench) -> None:
        with pytest.raises(ValueError, match="leak, error or navigation"):
            bench.node.fail("radio")
