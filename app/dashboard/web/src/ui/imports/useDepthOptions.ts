import { useSignal } from "@preact/signals";
import type { DepthOptions } from "./DepthOptions";

/** Options that nobody has typed yet. */
export function useDepthOptions(): DepthOptions {
  return {
    crs: useSignal(""),
    positive: useSignal(""),
    sd_m: useSignal(""),
    order: useSignal(""),
    datum_offset_m: useSignal(""),
    source: useSignal(""),
  };
}
