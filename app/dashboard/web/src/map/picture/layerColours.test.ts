import { describe, expect, it } from "vitest";
import type { LayerView } from "../../api/types";
import { classShares, rangeFault } from "./layerColours";
import { type SeaFloor, UNKNOWN } from "./seafloor";

describe("the ends of a colour range", () => {
  it("are taken when the lower is below the upper", () => {
    expect(rangeFault("-2.5", "8")).toBe("");
  });

  it("are refused with the reason", () => {
    expect(rangeFault("8", "4")).toBe("The lower end, 8, must be below the upper one, 4");
    expect(rangeFault("", "4")).toBe("Both ends need a number");
    expect(rangeFault("x", "4")).toBe("Both ends need a number");
  });
});

describe("classes", () => {
  it("have their shares of the cells that have a value", () => {
    const map = { layers: { density: Int32Array.from([0, 2, 2, UNKNOWN, 1]) } } as unknown as SeaFloor;
    const shown = { name: "density", classes: ["none", "few", "enough"] } as unknown as LayerView;
    expect(classShares(map, shown)).toEqual([0.25, 0.25, 0.5]);
  });
});
