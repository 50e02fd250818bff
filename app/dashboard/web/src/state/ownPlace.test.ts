import { afterEach, describe, expect, it } from "vitest";
import type { LngLat } from "../api/types";
import { metresPerDegree } from "../map/geo";
import { units } from "./format";
import { ownPlace, wayTo } from "./ownPlace";

const SHIP = { lat_deg: 41.18, lon_deg: -8.7, current: true };
const DEVICE = { at: [-8.6, 41.1] as LngLat };

describe("the own place", () => {
  it.each([
    ["the own ship's", SHIP, true, DEVICE, [-8.7, 41.18]],
    [
      "the device's where the own ship was not heard lately",
      { ...SHIP, current: false },
      true,
      DEVICE,
      [-8.6, 41.1],
    ],
    ["the device's where the service is silent", SHIP, false, DEVICE, [-8.6, 41.1]],
    ["the device's where no ship is heard", null, true, DEVICE, [-8.6, 41.1]],
    ["not known where neither is", { ...SHIP, current: false }, true, null, null],
  ] as const)("is %s", (_, ship, told, device, place) => {
    expect(ownPlace(ship, told, device)).toEqual(place);
  });
});

describe("the way to a vehicle", () => {
  afterEach(() => {
    units.value = "metric";
  });
  const from: LngLat = [-8.7, 41.18];
  const at = (metres: number, bearing_deg: number) => {
    const scale = metresPerDegree(41.18);
    const angle = (bearing_deg * Math.PI) / 180;
    return {
      lat_deg: 41.18 + (metres * Math.cos(angle)) / scale.north,
      lon_deg: -8.7 + (metres * Math.sin(angle)) / scale.east,
    };
  };

  it.each([
    [1200, 74, "1.20 km, 074°"],
    [340, 359.8, "340 m, 000°"],
    [85, 270, "85 m, 270°"],
  ])("over %d m at %d° is said with three digits", (metres, bearing_deg, words) => {
    expect(wayTo(at(metres, bearing_deg), from)).toBe(words);
  });

  it("is in nautical miles where these were chosen", () => {
    units.value = "nautical";
    expect(wayTo(at(1852, 8), from)).toBe("1.00 nmi, 008°");
  });

  it("is not said where the vehicle or the own place is not known", () => {
    expect(wayTo({ lat_deg: null, lon_deg: null }, from)).toBeNull();
    expect(wayTo(at(340, 10), null)).toBeNull();
  });

  it("is the short one over the date line", () => {
    expect(wayTo({ lat_deg: 0, lon_deg: -179.999 }, [179.999, 0])).toBe("223 m, 090°");
  });
});
