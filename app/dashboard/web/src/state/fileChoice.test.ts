import { describe, expect, it } from "vitest";
import type { ProductView } from "../api/types";
import { chosenHref, type FileOption, taken } from "./fileChoice";

const product = (...options: FileOption[]): ProductView => ({
  name: "tif",
  title: "",
  media_type: "",
  href: "/map.tif",
  needs_map: true,
  options,
});

describe("the choice for files", () => {
  const choice = { crs: "utm", order: "special", interval_m: "0.5", vehicle: "a & b" };

  it("is asked of those that take it, and of no other", () => {
    expect(chosenHref(product("order", "crs"), choice)).toBe("/map.tif?order=special&crs=utm");
    expect(chosenHref(product("interval_m"), choice)).toBe("/map.tif?interval_m=0.5");
    expect(chosenHref(product("vehicle"), choice)).toBe("/map.tif?vehicle=a+%26+b");
    expect(chosenHref(product(), choice)).toBe("/map.tif");
  });

  it("leaves to the service what was not chosen", () => {
    expect(chosenHref(product("order", "crs", "lang"), { crs: "", order: "1a" })).toBe("/map.tif?order=1a");
    expect(chosenHref(product("order", "crs", "lang"), {})).toBe("/map.tif");
  });

  it("is shown where a file takes it", () => {
    const products = [product("order"), product("vehicle")];
    expect((["order", "vehicle", "crs"] as const).map((one) => taken(products, one))).toEqual([
      true,
      true,
      false,
    ]);
  });
});
