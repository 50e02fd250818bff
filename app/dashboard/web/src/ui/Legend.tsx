import { type Signal, useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { gridOf, type Layer, PALETTES, type Range } from "../map/bathymetry";
import { fixedRanges, layer, seaFloor, showHatching, shownRange } from "../state/store";

const TITLES: Record<Layer, string> = { depth: "Depth", uncertainty: "Standard deviation" };

/** Layer switch, colour scale and its range, which stays what the operator set until changed. */
export function Legend() {
  const map = seaFloor.value;
  const range = shownRange.value;
  const fixed = fixedRanges.value[layer.value] !== undefined;
  const setRange = (next: Range | undefined) => {
    const { [layer.value]: _, ...others } = fixedRanges.value;
    fixedRanges.value = next ? { ...others, [layer.value]: next } : others;
  };
  return (
    <section class="legend" aria-label="Map layer and legend">
      <fieldset class="segments">
        <legend class="visually-hidden">Layer</legend>
        {(["depth", "uncertainty"] as const).map((name) => (
          <label key={name}>
            <input
              type="radio"
              name="layer"
              checked={layer.value === name}
              data-testid={`layer-${name}`}
              onChange={() => {
                layer.value = name;
              }}
            />
            <span>{name === "depth" ? "Depth" : "Uncertainty"}</span>
          </label>
        ))}
      </fieldset>
      {map && range ? (
        <>
          <div class="range-row">
            <RangeInputs range={range} onChange={setRange} key={`${layer.value} ${range.low} ${range.high}`}>
              <div
                class="scale"
                role="img"
                aria-label={`${TITLES[layer.value]} from ${range.low} to ${range.high} metres`}
                style={{ background: `linear-gradient(to right, ${PALETTES[layer.value].css})` }}
              />
            </RangeInputs>
            <span>m</span>
          </div>
          <span class="range-kind">
            {fixed ? (
              <button
                type="button"
                class="link-button"
                data-testid="range-fit"
                onClick={() => setRange(undefined)}
              >
                Fit to data
              </button>
            ) : (
              <button
                type="button"
                class="link-button"
                data-testid="range-fix"
                title="The colours follow the data now. Keep them, so that a colour goes on meaning the same depth"
                onClick={() => setRange(range)}
              >
                Keep range
              </button>
            )}
            {fixed ? <Outside share={shareOutside(gridOf(map, layer.value), range)} /> : null}
          </span>
          <label class="check">
            <input
              type="checkbox"
              checked={showHatching.value}
              data-testid="hatching"
              onChange={(event) => {
                showHatching.value = event.currentTarget.checked;
              }}
            />
            <span class="hatch-sample" aria-hidden="true" /> interpolated
          </label>
        </>
      ) : (
        <p class="empty">The sea floor appears with the first soundings</p>
      )}
    </section>
  );
}

interface RangeProps {
  range: Range;
  onChange: (range: Range) => void;
  /** What stands between the two ends. */
  children: ComponentChildren;
}

function RangeInputs({ range, onChange, children }: RangeProps) {
  const low = useSignal(String(range.low));
  const high = useSignal(String(range.high));
  const valid = low.value.trim() !== "" && high.value.trim() !== "" && Number(low.value) < Number(high.value);
  const commit = () => {
    const next = { low: Number(low.value), high: Number(high.value) };
    if (valid && (next.low !== range.low || next.high !== range.high)) onChange(next);
  };
  const end = (value: Signal<string>, label: string, name: string) => (
    <input
      type="text"
      inputMode="decimal"
      aria-label={label}
      aria-invalid={valid ? "false" : "true"}
      data-testid={name}
      value={value.value}
      onInput={(event) => {
        value.value = event.currentTarget.value;
      }}
      onBlur={commit}
    />
  );
  return (
    <form
      class="range"
      onSubmit={(event) => {
        event.preventDefault();
        commit();
      }}
    >
      {end(low, "Lower end of the colour range, metres", "range-low")}
      {children}
      {end(high, "Upper end of the colour range, metres", "range-high")}
      <button type="submit" class="visually-hidden" tabIndex={-1}>
        Set the range
      </button>
    </form>
  );
}

function shareOutside(grid: (number | null)[][], { low, high }: Range): number {
  const known = grid.flat().filter((value) => value !== null);
  return known.length === 0 ? 0 : known.filter((value) => value < low || value > high).length / known.length;
}

function Outside({ share }: { share: number }) {
  return share > 0 ? <small>{(share * 100).toFixed(share < 0.1 ? 1 : 0)} % outside</small> : null;
}
