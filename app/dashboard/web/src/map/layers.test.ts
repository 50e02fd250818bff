import { describe, expect, it } from "vitest";
import { rangeFault } from "./layers";

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
