/** Keeps the keyboard near where it was when what had it is taken from the page, as orders are that no longer can be given. */

/** Parts of the page that can have it. */
const PARTS = "article, section, aside, header, footer, main, [tabindex]";

const around = (element: Element | null): HTMLElement[] =>
  element instanceof HTMLElement && element !== document.body
    ? [element, ...around(element.parentElement)]
    : [];

/** Only for as long as it stays there: who clicks on a part does not mean all of it. */
function giveFocus(part: HTMLElement): void {
  if (!part.hasAttribute("tabindex")) {
    part.tabIndex = -1;
    part.addEventListener("blur", () => part.removeAttribute("tabindex"), { once: true });
  }
  part.focus({ preventScroll: true });
}

/** Follows the keyboard within the page; returns what ends it. */
export function keepFocus(root: HTMLElement): () => void {
  /** What had it last, and what that stood in. */
  let path: HTMLElement[] = [];
  const note = () => {
    if (document.activeElement !== document.body) path = around(document.activeElement);
  };
  // Who points at nothing leaves it.
  const leave = () => {
    path = around(document.activeElement);
  };
  const watcher = new MutationObserver(() => {
    if (document.activeElement !== document.body || path[0]?.isConnected !== false) return;
    const part = path.find((one) => one.isConnected && one.matches(PARTS));
    if (part) giveFocus(part);
  });
  watcher.observe(root, { childList: true, subtree: true });
  root.addEventListener("focusin", note);
  window.addEventListener("pointerup", leave);
  return () => {
    watcher.disconnect();
    root.removeEventListener("focusin", note);
    window.removeEventListener("pointerup", leave);
  };
}
