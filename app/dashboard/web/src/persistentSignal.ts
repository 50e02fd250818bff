import { effect, type Signal, signal } from "@preact/signals";

/** A signal whose value outlives the page, on this device only. */
export function kept<T>(name: string, otherwise: T): Signal<T> {
  const key = `bathyfleet.${name}`;
  let start = otherwise;
  try {
    const stored = localStorage.getItem(key);
    if (stored !== null) start = JSON.parse(stored) as T;
  } catch {
    // A page without storage, or a value of another version: begin afresh.
  }
  const value = signal<T>(start);
  let first = true;
  effect(() => {
    const text = JSON.stringify(value.value);
    if (first) {
      first = false;
      return;
    }
    try {
      localStorage.setItem(key, text);
    } catch {
      // Nothing is kept then.
    }
  });
  return value;
}
