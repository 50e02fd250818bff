/** A sheet of paper has another shape than the window: the map is printed as it is seen, made smaller as one picture. */

/** A4 on its side without its margins, in the pixels of style sheets, and how much of its height the map gets. */
const PAPER_PX = { width: 1047, height: 390 };

/** Tells the print style how large the map is; returns what ends that. */
export function watchPrinting(root: HTMLElement): () => void {
  const measure = () => {
    const map = root.querySelector(".chart")?.getBoundingClientRect();
    if (!map || map.width === 0) return;
    const fit = Math.min(PAPER_PX.width / map.width, PAPER_PX.height / map.height);
    root.style.setProperty("--map-width", `${map.width}px`);
    root.style.setProperty("--map-height", `${map.height}px`);
    root.style.setProperty("--map-fit", String(fit));
  };
  window.addEventListener("beforeprint", measure);
  return () => window.removeEventListener("beforeprint", measure);
}
