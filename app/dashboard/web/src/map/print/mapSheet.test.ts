import { inflateSync } from "node:zlib";
import { describe, expect, it } from "vitest";
import { Projection } from "../canvas/projection";
import { fitted, metresPerPixel, roundLength, sheetFor } from "./mapSheet";
import { pdfOf } from "./pdf";

describe("the sheet of a map", () => {
  it("lies on its side for what is wide, and stands for what is high", () => {
    const wide = sheetFor(900, 500);
    const high = sheetFor(400, 500);
    expect(wide.width).toBeGreaterThan(wide.height);
    expect(high.width).toBeLessThan(high.height);
    expect([wide.width, wide.height]).toEqual([high.height, high.width]);
  });

  it("shows the seen part of the window, whole and in the middle", () => {
    const seen = new Projection({ centre: [-8.7, 41.18], zoom: 17 }, 1200, 800);
    const part = { left: 300, top: 60, width: 600, height: 500 };
    const frame = { width: 1000, height: 600 };
    const at = fitted(seen, part, frame);
    const [west, north] = seen.place(part.left, part.top);
    const [east, south] = seen.place(part.left + part.width, part.top + part.height);
    expect(at.y(north)).toBeCloseTo(0, 6);
    expect(at.y(south)).toBeCloseTo(600, 6);
    expect((at.x(west) + at.x(east)) / 2).toBeCloseTo(500, 6);
    expect(at.x(west)).toBeGreaterThan(0);
  });

  it("is as large as the latitude makes it", () => {
    const at = (lat: number) => metresPerPixel(new Projection({ centre: [0, lat], zoom: 0 }, 10, 10));
    expect(at(0)).toBeCloseTo(78_271.5, 0);
    expect(at(60) / at(0)).toBeCloseTo(0.5, 6);
  });

  it.each([
    [137, false, 100],
    [49, false, 20],
    [5200, false, 5000],
    [5200, true, 3704],
    [400, true, 370.4],
    [100, true, 100],
  ])("has a scale of a round length below %d m (nautical: %s)", (most, nautical, length) => {
    expect(roundLength(most, nautical)).toBeCloseTo(length, 6);
  });
});

it("a PDF holds the picture's pixels, its objects where its table says", async () => {
  const data = new Uint8ClampedArray([255, 0, 0, 255, 0, 0, 255, 0]);
  const picture = { data, width: 2, height: 1 } as unknown as ImageData;
  const blob = await pdfOf(picture, { width: 1123, height: 794 }, "Cais nº 1 (maré)");
  const bytes = Buffer.from(await blob.arrayBuffer());
  const text = bytes.toString("latin1");
  expect(text.startsWith("%PDF-1.4\n")).toBe(true);
  const table = Number(/startxref\n(\d+)\n%%EOF/.exec(text)?.[1]);
  expect(text.slice(table, table + 4)).toBe("xref");
  const begins = [...text.slice(table).matchAll(/(\d{10}) 00000 n/g)].map(([, at]) => Number(at));
  expect(begins).toHaveLength(6);
  begins.forEach((at, i) => {
    expect(text.slice(at).startsWith(`${i + 1} 0 obj`)).toBe(true);
  });
  const length = Number(/FlateDecode \/Length (\d+)/.exec(text)?.[1]);
  const begin = text.indexOf("stream\n", text.indexOf("FlateDecode")) + 7;
  // What is transparent lies on white.
  expect([...inflateSync(bytes.subarray(begin, begin + length))]).toEqual([255, 0, 0, 255, 255, 255]);
  expect(text).toContain("/MediaBox [0 0 842.25 595.50]");
});
