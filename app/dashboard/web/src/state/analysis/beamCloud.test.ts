import { describe, expect, it } from "vitest";
import type { BeamPoints } from "../../api/types";
import { beamCloud, groundRound, namedBeams } from "./beamCloud";

const found: BeamPoints = {
  total: 5,
  every: 1,
  lon_deg: [-8.7, -8.699, -8.698, -8.697, -8.696],
  lat_deg: [41.1, 41.101, 41.102, 41.1, 41.1],
  depth_m: [12, 7, 12, 12, 4],
  state: [0, 0, 0, 0, 1],
  ping: [0, 0, 1, 1, 2],
  beam: [3, 4, 3, 9, 0],
  time_s: [100.25, 101.5, 102],
  vehicle: [0, 0, 1],
  states: ["used", "doubted", "withdrawn", "restored"],
  vehicles: ["lauv-1", "lauv-2"],
};

describe("beams as points", () => {
  it("have their states", () => {
    expect(beamCloud(found).state).toEqual(["used", "used", "used", "used", "doubted"]);
    expect(beamCloud(found).total).toBe(5);
  });

  it("are named ping by ping, with the time to its last digit", () => {
    expect(namedBeams(found, [1, 4, 0])).toEqual([
      { vehicle: "lauv-1", time_s: 100.25, beams: [4, 3] },
      { vehicle: "lauv-2", time_s: 102, beams: [0] },
    ]);
    expect(namedBeams(found, [])).toEqual([]);
  });

  it("lie on the ground round them", () => {
    const ring = groundRound(found, [1, 2])?.coordinates[0] ?? [];
    expect(ring[0]).toEqual(ring.at(-1));
    for (const k of [1, 2]) {
      const [lng, lat] = [found.lon_deg[k] as number, found.lat_deg[k] as number];
      expect(lng > (ring[0]?.[0] ?? 0) && lng < (ring[2]?.[0] ?? 0)).toBe(true);
      expect(lat > (ring[0]?.[1] ?? 0) && lat < (ring[2]?.[1] ?? 0)).toBe(true);
    }
    expect(groundRound(found, [])).toBeNull();
  });
});
