import { expect, test } from "vitest";
import { tiesIn } from "./ties";

const answer = (...places: [number, number][]) =>
  ({
    ties: {
      type: "FeatureCollection",
      features: places.map((coordinates, number) => ({
        type: "Feature",
        properties: { number },
        geometry: { type: "Point", coordinates },
      })),
    },
  }) as unknown as Parameters<typeof tiesIn>[0];

test("ties lie north up and to scale", () => {
  const { height, drawn } = tiesIn(answer([-8.7, 41.18], [-8.699, 41.181]), 100);
  expect(height).toBeCloseTo(100, 6);
  const [southWest, northEast] = drawn;
  expect(southWest?.y).toBeCloseTo(100, 6);
  expect(northEast?.y).toBe(0);
  expect((northEast?.x ?? 0) - (southWest?.x ?? 0)).toBeCloseTo(100 * Math.cos((41.18 * Math.PI) / 180), 0);
});

test("a picture of one tie or none has a size", () => {
  expect(tiesIn(answer(), 100)).toEqual({ height: 0, drawn: [] });
  const { height, drawn } = tiesIn(answer([-8.7, 41.18]), 100);
  expect([height, drawn.length, Number.isFinite(drawn[0]?.x)]).toEqual([0, 1, true]);
});
