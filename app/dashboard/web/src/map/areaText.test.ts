import { strToU8, zipSync } from "fflate";
import { expect, it } from "vitest";
import { areaText } from "./areaText";

const KML = "<kml><Document/></kml>";
const file = (name: string, content: Uint8Array | string) =>
  new File([typeof content === "string" ? content : new Uint8Array(content)], name);

it("a text is as it is", async () => {
  expect(await areaText(file("bay.geojson", '{"type":"Point"}'))).toBe('{"type":"Point"}');
  expect(await areaText(file("bay.kml", "Leixões"))).toBe("Leixões");
});

it("of a KMZ the first document is read, whatever it is called", async () => {
  const archive = zipSync({
    "files/icon.png": strToU8("none"),
    "doc.kml": strToU8(KML),
    "later.kml": strToU8("<kml/>"),
  });
  expect(await areaText(file("bay.kmz", archive))).toBe(KML);
  expect(await areaText(file("bay.zip", archive))).toBe(KML);
});

it("an archive without a document, or one that is broken, is told", async () => {
  await expect(areaText(file("icons.kmz", zipSync({ "icon.png": strToU8("none") })))).rejects.toThrow(
    "icons.kmz holds no KML document",
  );
  const archive = zipSync({ "doc.kml": strToU8(KML) });
  await expect(areaText(file("cut.kmz", archive.slice(0, archive.length - 30)))).rejects.toThrow(
    "cut.kmz cannot be unpacked",
  );
});
