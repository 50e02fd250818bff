import { expect, it } from "vitest";
import { waterDepth_m } from "./water";

it.each([
  [{ depth_m: 3.2, altitude_m: 8.1 }, true, 11.3],
  [{ depth_m: 0, altitude_m: 8.1 }, true, 8.1],
  [{ depth_m: 3.2, altitude_m: null }, true, null],
  [{ depth_m: null, altitude_m: 8.1 }, true, null],
  [{ depth_m: 3.2, altitude_m: 8.1 }, false, null],
])("water over %j, told lately: %s, is %s m deep", (heights, fresh, depth_m) => {
  const found = waterDepth_m(heights, fresh);
  if (depth_m === null) expect(found).toBeNull();
  else expect(found).toBeCloseTo(depth_m, 9);
});
