import { describe, expect, it } from "vitest";
import { labelPlaces, type Pixel, simplified } from "./polylines";
import { moved, Projection } from "./projection";

const thin = (points: Pixel[], tolerance = 0.4) =>
  simplified(points.length, (i) => points[i] as Pixel, tolerance);

/** Distance of a point from a line of pieces. */
function off([x, y]: Pixel, line: Pixel[]): number {
  let least = Number.POSITIVE_INFINITY;
  for (let i = 1; i < line.length; i++) {
    const [ax, ay] = line[i - 1] as Pixel;
    const [bx, by] = line[i] as Pixel;
    const square = (bx - ax) ** 2 + (by - ay) ** 2;
    const share = square
      ? Math.max(0, Math.min(1, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / square))
      : 0;
    least = Math.min(least, Math.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay)));
  }
  return least;
}

describe("a line without what nobody sees", () => {
  it("is straight where it was straight, and turns where it turned", () => {
    const line: Pixel[] = [];
    for (let i = 0; i <= 100; i++) line.push([i, 0]);
    for (let i = 1; i <= 100; i++) line.push([100, i]);
    for (let i = 1; i <= 50; i++) line.push([100, 100 - i]);
    expect(thin(line)).toEqual([
      [0, 0],
      [100, 0],
      [100, 100],
      [100, 50],
    ]);
  });

  it("stays near every point of any wandering line, in both directions", () => {
    let seed = 7;
    const random = () => {
      seed = (seed * 16807) % 2147483647;
      return seed / 2147483647 - 0.5;
    };
    for (let run = 0; run < 20; run++) {
      const line: Pixel[] = [[0, 0]];
      let heading = 0;
      for (let i = 0; i < 400; i++) {
        heading += random() * (run / 10);
        const [x, y] = line.at(-1) as Pixel;
        line.push([x + 1.5 * Math.cos(heading), y + 1.5 * Math.sin(heading)]);
      }
      const kept = thin(line);
      expect(kept[0]).toEqual(line[0]);
      expect(kept.at(-1)).toEqual(line.at(-1));
      expect(kept.length).toBeLessThan(line.length);
      expect(Math.max(...line.map((point) => off(point, kept)))).toBeLessThan(0.85);
      expect(kept.every((point) => line.includes(point))).toBe(true);
    }
  });

  it("of one place or none is that", () => {
    expect(thin([])).toEqual([]);
    expect(thin([[3, 4]])).toEqual([[3, 4]]);
  });
});

describe("labels along a line", () => {
  it("come at even distances and are never upside down", () => {
    const there: Pixel[] = Array.from({ length: 61 }, (_, i): Pixel => [10 * i, 5]);
    const places = labelPlaces(there, 30, 200);
    expect(places.map((p) => Math.round(p.x))).toEqual([100, 300, 500]);
    for (const { angle } of labelPlaces(there.toReversed(), 30, 200)) expect(angle).toBeCloseTo(0);
  });

  it("avoid the line's ends and sharp turns", () => {
    expect(
      labelPlaces(
        [
          [0, 0],
          [40, 0],
        ],
        60,
        40,
      ),
    ).toEqual([]);
    const corner: Pixel[] = [
      [0, 0],
      [50, 0],
      [0, 3],
      [50, 6],
    ];
    expect(labelPlaces(corner, 40, 100)).toEqual([]);
  });
});

describe("the window on the map", () => {
  const at = new Projection({ centre: [-8.7, 41.18], zoom: 18.3 }, 1000, 700);

  it("has its camera's centre in the middle and finds places again", () => {
    expect([at.x(-8.7), at.y(41.18)]).toEqual([500, 350]);
    const [lng, lat] = at.place(120, 600);
    expect([at.x(lng), at.y(lat)].map((v) => v.toFixed(3))).toEqual(["120.000", "600.000"]);
  });

  it("shows a picture drawn for another camera where it belongs", () => {
    const larger = new Projection({ centre: [-8.7003, 41.1801], zoom: 17.9 }, 1500, 1050);
    const { x, y, scale } = moved(larger, at);
    const place = larger.place(900, 300);
    expect(x + 750 + scale * (900 - 750)).toBeCloseTo(at.x(place[0]), 2);
    expect(y + 525 + scale * (300 - 525)).toBeCloseTo(at.y(place[1]), 2);
  });
});
