/** The text of a file of areas: as it is, or the document in a KMZ. */

import { unzipSync } from "fflate";
import { say } from "../words/say";

/** Documents are told by their names; an archive that unpacks to more than this is no outline of an area. */
const MOST_BYTES = 64 * 1024 * 1024;

/** What is read as a file of areas. */
export const AREA_FILES = ".geojson,.json,.kml,.kmz,.gpx";

/** Whether a file's name says that it is one. */
export const isAreaFile = (name: string): boolean =>
  AREA_FILES.split(",").some((ending) => name.toLowerCase().endsWith(ending));

/** Returns the text. Throws an error in the page's words for an archive without a document. */
export async function areaText(file: File): Promise<string> {
  const bytes = new Uint8Array(await file.arrayBuffer());
  const isArchive = bytes[0] === 0x50 && bytes[1] === 0x4b;
  return new TextDecoder().decode(isArchive ? documentIn(bytes, file.name) : bytes);
}

/** The first KML document of an archive, as Google Earth takes it. */
function documentIn(archive: Uint8Array, name: string): Uint8Array {
  let wanted = "";
  let documents: Record<string, Uint8Array>;
  try {
    documents = unzipSync(archive, {
      filter: (entry) => {
        if (wanted || !/\.kml$/i.test(entry.name) || entry.originalSize > MOST_BYTES) return false;
        wanted = entry.name;
        return true;
      },
    });
  } catch {
    throw new Error(say("area.theArchiveCannotBeRead", { name }));
  }
  const found = documents[wanted];
  if (!found) throw new Error(say("area.noDocumentInTheArchive", { name }));
  return found;
}
