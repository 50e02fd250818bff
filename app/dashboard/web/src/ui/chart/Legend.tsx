import "./Legend.css";
import { type Signal, useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import type { LayerView } from "../../api/types";
import { SITE_COLOURS, SITE_WORDS } from "../../map/marks/site";
import { drawingOf, drawnBy, drawnShares } from "../../map/picture/drawings";
import {
  classShares,
  paletteOf,
  type Range,
  rangeFault,
  shareOutside,
  symbolOf,
} from "../../map/picture/layerColours";
import { colourAt, DEPTH_PALETTES, type Palette, type Rgb } from "../../map/picture/palette";
import type { SeaFloor } from "../../map/picture/seafloor";
import { fixed, pointed } from "../../state/format";
import { PHASE_WORDS } from "../../state/stateNames";
import {
  depthPalette,
  fixedRanges,
  layer,
  layers,
  legendOpen,
  lightFrom,
  mission,
  seaFloor,
  sharpCells,
  showContours,
  showHatching,
  shownCertainty,
  shownLayer,
  shownRange,
  showSite,
  site,
} from "../../state/store";
import { named, say } from "../../words/say";
import { Button, Choice, flips, into, titles } from "../parts/Controls";
import { STAGES, VehicleShape } from "../parts/marks";

/** Layer switch, colour scale and its range, which stays what the operator set until changed. */
export function Legend() {
  const map = seaFloor.value;
  const range = shownRange.value;
  const shown = shownLayer.value;
  if (!mission.value || !shown) return null;
  const palette = paletteOf(shown, depthPalette.value);
  const drawn = drawnBy(shown);
  return (
    <section
      class={`legend${legendOpen.value ? "" : " folded"}`}
      aria-label={say("legend.mapLayerAndLegend")}
    >
      <label class="layer-choice">
        <span class="visually-hidden">{say("legend.layer")}</span>
        <Choice
          value={layer.value}
          options={layers.value
            .filter(({ scale }) => scale !== null)
            .map(({ name, title }) => [name, named("layer", name, title)])}
          title={sentence(shown.meaning)}
          id="layer"
          onChoose={into(layer)}
        />
      </label>
      {map && range ? (
        drawn ? (
          <Classes
            words={drawingOf(drawn).words()}
            colours={drawingOf(drawn).colours}
            shares={drawnShares(map, shown.name, drawingOf(drawn))}
            id={drawn}
          />
        ) : shown.classes.length > 0 ? (
          <Classes
            words={shown.classes}
            colours={shown.classes.map((_, i) => colourAt(palette, i, range.low, range.high))}
            shares={classShares(map, shown)}
            id={shown.name}
          />
        ) : (
          <Scale shown={shown} palette={palette} range={range} key={shown.name} />
        )
      ) : (
        <p class="empty">{map ? missing(map, shown) : say("legend.theSeaFloorAppearsWithThe")}</p>
      )}
      <Button
        id="toggle-legend"
        kind="fold"
        aria-expanded={legendOpen.value}
        title={legendOpen.value ? say("legend.showOnlyTheScale") : say("legend.coloursLightContoursAndWhat")}
        onClick={flips(legendOpen)}
      >
        {legendOpen.value ? say("legend.less") : say("legend.more")}
      </Button>
      {legendOpen.value ? (
        <>
          {map ? <Options shown={shown} /> : null}
          {site.value && showSite.value ? <SiteStates /> : null}
          {mission.value.vehicles.some((v) => v.recovery_point !== null) ? <Stages /> : null}
        </>
      ) : null}
    </section>
  );
}

function missing(map: SeaFloor, { name, absence, remedy }: LayerView): string {
  return absence && map.layers[name] ? `${sentence(absence)}. ${remedy}` : say("legend.thisLayerIsOnItsWay");
}

const sentence = (words: string) => words.charAt(0).toUpperCase() + words.slice(1);

function Scale({ shown, palette, range }: { shown: LayerView; palette: Palette; range: Range }) {
  const unit = symbolOf(shown);
  const map = seaFloor.value;
  const fixed = fixedRanges.value[shown.name] !== undefined;
  const edited = useSignal<Ends | null>(null);
  const setRange = (next: Range | undefined) => {
    edited.value = null;
    const { [shown.name]: _, ...others } = fixedRanges.value;
    fixedRanges.value = next ? { ...others, [shown.name]: next } : others;
  };
  return (
    <>
      <div class="range-row">
        <RangeInputs range={range} edited={edited} onChange={setRange}>
          <div
            class="scale"
            role="img"
            aria-label={say("legend.fromTo", {
              title: named("layer", shown.name, shown.title),
              low: range.low,
              high: range.high,
              unit,
            })}
            style={{
              background: `linear-gradient(to right, ${palette.css})`,
            }}
          />
        </RangeInputs>
        <span>{unit}</span>
      </div>
      <span class="range-kind">
        {fixed ? (
          <Button id="range-fit" kind="link-button" onClick={() => setRange(undefined)}>
            {say("legend.fitToData")}
          </Button>
        ) : (
          <Button
            id="range-fix"
            kind="link-button"
            title={say("legend.theColoursFollowTheDataNow")}
            onClick={() => setRange(range)}
          >
            {say("legend.keepRange")}
          </Button>
        )}
        {fixed && map ? <Outside share={shareOutside(map, shown, range)} /> : null}
      </span>
    </>
  );
}

interface ClassesProps {
  words: readonly string[];
  colours: readonly Rgb[];
  /** Of the cells; empty while they are not known. */
  shares: readonly number[];
  id: string;
}

/** A layer whose values are classes, with each one's share of the cells. */
function Classes({ words, colours, shares, id }: ClassesProps) {
  return (
    <ul class="landmarks" data-testid={id}>
      {words.map((one, i) => (
        <li key={one}>
          <span class="swatch" style={{ background: `rgb(${colours[i]?.join(" ")})` }} /> {one}
          {shares.length > 0 ? ` ${fixed((shares[i] ?? 0) * 100, 0)} %` : ""}
        </li>
      ))}
    </ul>
  );
}

function SiteStates() {
  return (
    <ul class="landmarks" data-testid="site-legend">
      {Object.entries(SITE_WORDS).map(([name, words]) => {
        const [r, g, b, a] = SITE_COLOURS[name as keyof typeof SITE_COLOURS];
        return (
          <li key={name}>
            <span class="swatch" style={{ background: `rgb(${r} ${g} ${b} / ${a / 255})` }} /> {words}
          </li>
        );
      })}
    </ul>
  );
}

/** What the vehicles' shapes on the map mean. */
function Stages() {
  return (
    <ul class="landmarks stages" data-testid="stage-legend">
      {STAGES.map((stage) => (
        <li key={stage}>
          <VehicleShape stage={stage} colour="#8a9ca8" heading_deg={0} size={18} />{" "}
          {PHASE_WORDS[stage === "surveying" ? "survey" : stage]}
        </li>
      ))}
    </ul>
  );
}

/** Sides that light can come from. */
const SIDES = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"] as const;
const lights = (): readonly (readonly [value: string, words: string])[] => [
  ...SIDES.map((side, i) => [String((i * 360) / SIDES.length), say("legend.lightFrom", { side })] as const),
  ["none", say("legend.noLightAndShadow")],
];

function Options({ shown }: { shown: LayerView }) {
  return (
    <>
      {shown.palette === "deep" ? (
        <>
          <label>
            <span class="visually-hidden">{say("legend.coloursOfDepths")}</span>
            <Choice
              value={depthPalette.value}
              options={titles(DEPTH_PALETTES)}
              title={say("legend.coloursOfDepths")}
              id="palette"
              onChoose={into(depthPalette)}
            />
          </label>
          <Choice
            value={lightFrom.value === null ? "none" : String(lightFrom.value)}
            options={lights()}
            label={say("legend.whereLightComesFrom")}
            title={say("legend.heightsAreExaggeratedUntil")}
            id="light"
            onChoose={(side) => {
              lightFrom.value = side === "none" ? null : Number(side);
            }}
          />
        </>
      ) : null}
      <Check signal={showContours} id="contours">
        {say("legend.contours")}
      </Check>
      <Check signal={sharpCells} id="sharp-cells">
        {say("legend.sharpCells")}
      </Check>
      {shown.of_depths ? <Guesses /> : null}
    </>
  );
}

/** How what was not measured is drawn. */
function Guesses() {
  const certainty = shownCertainty.value;
  return (
    <>
      <Check signal={showHatching} id="hatching">
        <span class="hatch-sample" aria-hidden="true" /> {say("legend.guessed")}
      </Check>
      {certainty ? (
        <span class="certainty" data-testid="certainty">
          {say("legend.fadesFromMNothingFromM", {
            fullM: round(certainty.full_m),
            noneM: round(certainty.none_m),
          })}
        </span>
      ) : null}
    </>
  );
}

const round = (value_m: number) => Number(value_m.toPrecision(2));

function Check({
  signal,
  id,
  children,
}: {
  signal: Signal<boolean>;
  id: string;
  children: ComponentChildren;
}) {
  return (
    <label class="check">
      <input
        type="checkbox"
        checked={signal.value}
        data-testid={id}
        onChange={(event) => {
          signal.value = event.currentTarget.checked;
        }}
      />
      {children}
    </label>
  );
}

/** Both ends of a colour range as they stand in their fields. */
interface Ends {
  low: string;
  high: string;
  typed: boolean;
}

interface RangeProps {
  range: Range;
  /** What stands in the fields while they are edited: no data change it, and both ends belong together. */
  edited: Signal<Ends | null>;
  onChange: (range: Range) => void;
  /** What stands between the two ends. */
  children: ComponentChildren;
}

function RangeInputs({ range, edited, onChange, children }: RangeProps) {
  const ends = edited.value ?? { low: String(range.low), high: String(range.high), typed: false };
  const fault = rangeFault(ends.low, ends.high);
  const commit = () => {
    // Read anew: Enter may come before what was typed last has been drawn.
    const { low, high, typed } = edited.value ?? ends;
    if (rangeFault(low, high)) return;
    edited.value = null;
    if (typed) onChange({ low: Number(low), high: Number(high) });
  };
  const end = (which: keyof Range, label: string) => (
    <input
      type="text"
      inputMode="decimal"
      aria-label={label}
      aria-invalid={fault ? "true" : "false"}
      data-testid={`range-${which}`}
      value={ends[which]}
      onFocus={() => {
        edited.value ??= ends;
      }}
      onInput={(event) => {
        const text = pointed(event.currentTarget.value);
        edited.value = { ...(edited.value ?? ends), [which]: text, typed: true };
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
      {end("low", say("legend.lowerEndOfTheColourRange"))}
      {children}
      {end("high", say("legend.upperEndOfTheColourRange"))}
      {fault ? (
        <span class="fault range-fault" role="alert" data-testid="range-fault">
          ▲ {fault}
        </span>
      ) : null}
      <button type="submit" class="visually-hidden" tabIndex={-1}>
        {say("legend.setTheRange")}
      </button>
    </form>
  );
}

function Outside({ share }: { share: number }) {
  return share > 0 ? (
    <small>{say("legend.outside", { share: fixed(share * 100, share < 0.1 ? 1 : 0) })}</small>
  ) : null;
}
