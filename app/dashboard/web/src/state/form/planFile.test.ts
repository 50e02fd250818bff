import { expect, it } from "vitest";
import type { LngLat, PlanView } from "../../api/types";
import { type NamedPlan, planGeoJson, planGpx } from "./planFile";

const WAY: LngLat[] = [
  [-8.7, 41.18],
  [-8.701, 41.1815],
  [-8.7, 41.183],
];

const planOf = (ways: Record<string, LngLat[]>): NamedPlan["plan"] =>
  ({ vehicles: Object.entries(ways).map(([vehicle, way]) => ({ vehicle, way })) }) as unknown as PlanView;

it("a plan is a line for each vehicle that goes anywhere", () => {
  const file = JSON.parse(planGeoJson([{ block: "", plan: planOf({ north: WAY, stays: WAY.slice(0, 1) }) }]));
  expect(file).toEqual({
    type: "FeatureCollection",
    features: [
      {
        type: "Feature",
        properties: { vehicle: "north" },
        geometry: { type: "LineString", coordinates: WAY },
      },
    ],
  });
});

it("lines of several blocks say of which they are", () => {
  const plans = ["Bay", "Bar"].map((block) => ({ block, plan: planOf({ north: WAY }) }));
  const { features } = JSON.parse(planGeoJson(plans));
  expect(features.map(({ properties }: { properties: unknown }) => properties)).toEqual([
    { vehicle: "north", block: "Bay" },
    { vehicle: "north", block: "Bar" },
  ]);
  expect(planGpx(plans)).toContain("<name>north, Bar</name>");
});

it("a plan is a route for each vehicle, latitude and longitude apart", () => {
  const text = planGpx([{ block: "", plan: planOf({ "N & <S>": WAY, south: WAY }) }]);
  expect(text.match(/<rte>/g)).toHaveLength(2);
  expect(text).toContain("<name>N &amp; &lt;S&gt;</name>");
  expect(text).toContain('<rtept lat="41.1815" lon="-8.701"/>');
  expect(
    text.startsWith('<?xml version="1.0" encoding="UTF-8"?>\n<gpx version="1.1" creator="bathyfleet"'),
  ).toBe(true);
});
