"""Figures about missions for GET /metrics."""

from prometheus_client import Counter, Gauge, Histogram

STEPS = Counter("bathyfleet_steps_total", "Committed mission steps")
SOUNDINGS = Counter("bathyfleet_soundings_total", "Soundings by verdict", ["verdict"])
PINGS = Counter("bathyfleet_pings_total", "Pings of swath sonars by verdict", ["verdict"])
BEAMS = Counter("bathyfleet_beams_total", "Beams of accepted pings that detected something")
PLANNING_SECONDS = Histogram(
    "bathyfleet_planning_seconds",
    "Time to make the map and decide one step",
    buckets=(0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30),
)
RUNNING = Gauge("bathyfleet_missions_running", "Missions whose flight runs in this process")
EVENTS = Counter("bathyfleet_mission_events_total", "Lines written to mission logs by level", ["level"])
ALARM_DELIVERIES = Counter(
    "bathyfleet_alarm_deliveries_total", "Attempts to tell somebody of an alarm by result", ["result"]
)
PACKETS_DROPPED = Counter(
    "bathyfleet_imc_packets_dropped_total", "IMC packets that this machine threw away because its socket was full"
)
