/** What is printed is on white paper whatever the screen's colours, with the map as a sheet of its own, large enough to read. */

import { printing } from "../../state/store";
import { printedMap } from "../chart/mapPicture";

/** Puts the map's sheet on the page while it is printed; returns what ends that. */
export function watchPrinting(root: HTMLElement): () => void {
  let sheet: HTMLCanvasElement | null = null;
  const after = () => {
    sheet?.remove();
    sheet = null;
    printing.value = false;
  };
  const before = () => {
    after();
    printing.value = true;
    sheet = printedMap();
    if (!sheet) return;
    sheet.className = "printed-map";
    sheet.dataset.testid = "printed-map";
    root.querySelector(".stage")?.append(sheet);
  };
  window.addEventListener("beforeprint", before);
  window.addEventListener("afterprint", after);
  return () => {
    window.removeEventListener("beforeprint", before);
    window.removeEventListener("afterprint", after);
    after();
  };
}
