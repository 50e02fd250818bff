import { expect, test } from "vitest";
import type { LngLat, OwnShipView, ShipView } from "../../api/types";
import { wayBetween } from "../geo";
import { ownShipMark, shipMarks, shipWords } from "./ships";

const AT: LngLat = [-8.7, 41.18];
const ship = {
  mmsi: 211000001,
  name: "EVA",
  type: "cargo",
  own: false,
  lon_deg: AT[0],
  lat_deg: AT[1],
  sog_mps: 5,
  cog_deg: 30,
  heading_deg: null,
  age_s: 2,
  closest: null,
} as ShipView;
const closest = { mission_id: "m", vehicle: "a", distance_m: 42.4, in_s: 125, alarm: true };

test("a ship points along its course, to where it will be in six minutes", () => {
  const mark = shipMarks([ship])[0];
  expect(mark?.bow_deg).toBe(30);
  const way = wayBetween(AT, mark?.ahead ?? AT);
  expect(way.metres).toBeCloseTo(1800, -1);
  expect(way.bearing_deg).toBeCloseTo(30, 0);
});

test("a ship that tells no course goes nowhere and points nowhere", () => {
  const mark = shipMarks([{ ...ship, cog_deg: null }])[0];
  expect(mark).toMatchObject({ at: AT, ahead: AT, bow_deg: null, alarm: false });
});

test("its words say who it is, and how close it comes to whom", () => {
  expect(shipWords(ship)).toBe("EVA (cargo), 9.7 kn");
  expect(shipWords({ ...ship, closest })).toBe("EVA (cargo), 9.7 kn, CPA 42 m from a in 2 min 5 s");
  expect(shipWords({ ...ship, name: "", own: true, sog_mps: null })).toBe("MMSI 211000001 (own)");
  expect(shipMarks([{ ...ship, closest }])[0]?.alarm).toBe(true);
});

test("its words say how long it was not heard, also while the service does not tell of it", () => {
  expect(shipWords({ ...ship, age_s: 250 })).toBe("EVA (cargo), 9.7 kn, last heard 4 min 10 s ago");
  expect(shipMarks([{ ...ship, closest }], 65)[0]?.words).toBe(
    "EVA (cargo), 9.7 kn, CPA 42 m from a in 1 min 0 s, last heard 1 min 7 s ago",
  );
});

test("the own ship points where her bow does, and is marked where she may be elsewhere by now", () => {
  const own = { lat_deg: 41.18, lon_deg: -8.7, cog_deg: 30, heading_deg: 40, age_s: 0.4, current: true };
  const ship = own as OwnShipView;
  expect(ownShipMark(ship, true)).toMatchObject({ at: AT, words: "Own ship", bow_deg: 40, old: false });
  expect(ownShipMark({ ...ship, heading_deg: null }, true).bow_deg).toBe(30);
  const old = { words: "Own ship, 25 s ago", old: true };
  expect(ownShipMark({ ...ship, current: false, age_s: 25 }, true)).toMatchObject(old);
  expect(ownShipMark(ship, false).old).toBe(true);
});
