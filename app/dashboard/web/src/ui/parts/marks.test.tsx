import { beforeAll, expect, it, vi } from "vitest";
import type { VehicleView } from "../../api/types";

// What signals of the page ask for when they are made.
beforeAll(() => {
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => undefined }));
});

it("a vehicle that is not heard tells for how long on the map, a simulation that is over does not", async () => {
  const { VehicleMark } = await import("./marks");
  const mark = (kind: VehicleView["kind"]) => {
    const view = { name: "a", kind, link: "unknown", active: true, withdrawn: "", breach: "" } as VehicleView;
    const vehicle = { view, waypoint: undefined, colour: "#fff", age_s: 421, stale: true };
    return VehicleMark({ vehicle })?.props as { age: string; title: string; stale: boolean };
  };
  expect(mark("imc")).toMatchObject({
    age: "7 min 01 s",
    title: "a, position 7 min 01 s old",
    stale: true,
  });
  expect(mark("sim")).toMatchObject({ age: "", title: "a", stale: true });
});
