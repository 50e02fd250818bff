import { expect, test } from "vitest";
import { csvOf, fileNameOf, lineWords } from "./plotFile";

test("a chart is a table with a row for each moment", () => {
  const lines = [
    { label: "a", values: [1, null] },
    { label: 'b "deep"', values: [2.5, 3] },
  ];
  expect(csvOf([0, 1.5], lines, "m", true)).toBe(
    'time_utc,a (m),"b ""deep"" (m)"\r\n1970-01-01T00:00:00.000Z,1,2.5\r\n1970-01-01T00:00:01.500Z,,3\r\n',
  );
  expect(csvOf([7], [{ label: "J", values: [0.5] }], "", false)).toBe("step,J\r\n7,0.5\r\n");
  expect(fileNameOf("Depth of vehicles")).toBe("depth-of-vehicles");
});

test("what a line did is said in words", () => {
  expect(lineWords({ label: "a", values: [null, 2, 12, 5] }, "m")).toBe(
    "a 5 m now, 2 m at first, between 2 m and 12.0 m",
  );
  expect(lineWords({ label: "a", values: [null] }, "m")).toBe("a: nothing is known");
});
