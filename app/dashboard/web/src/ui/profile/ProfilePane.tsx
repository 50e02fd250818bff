import "./ProfilePane.css";
import { useComputed, useSignal, useSignalEffect } from "@preact/signals";
import { useLayoutEffect } from "preact/hooks";
import { api } from "../../api/client";
import type { LngLat, ProfileView } from "../../api/types";
import {
  type Cut,
  csvOf,
  differenceAlong,
  lineText,
  lineTyped,
  typedLine,
} from "../../state/analysis/profile";
import { count, metres, plain } from "../../state/format";
import { said } from "../../state/session";
import {
  isDark,
  layers,
  measured,
  mission,
  missions,
  selectedId,
  shownCertainty,
  view,
} from "../../state/store";
import { named, say } from "../../words/say";
import { Button, Choice, into, Trouble } from "../parts/Controls";
import { save } from "../parts/download";
import { ProfileChart } from "./ProfileChart";

const INKS = ["#1d5c94", "#b8442b", "#2e7d6e", "#8c50b8"];
const DARK_INKS = ["#7ec3f5", "#ff9b7d", "#79d7c0", "#cfa6f0"];
/** Surveys in one chart: more than these cannot be told apart. */
const MOST = INKS.length;
/** While corners are dragged or soundings come in, the service is asked this often at most. */
const PAUSE_MS = 400;

/** The sea floor along the line that is measured on the map, in this survey and others. */
export function ProfilePane() {
  const others = useSignal<readonly string[]>([]);
  const layer = useSignal("");
  const found = useSignal<readonly ProfileView[]>([]);
  const fault = useSignal("");
  // The view changes several times a second, the map seldom.
  const version = useComputed(() => view.value.mapVersion);
  useSignalEffect(() => {
    selectedId.value;
    others.value = [];
  });
  useSignalEffect(() => {
    const line = measured.value ?? [];
    const ids = [selectedId.value, ...others.value].filter((id) => id !== null);
    const further = layer.value ? [layer.value] : [];
    version.value;
    if (line.length < 2) {
      found.value = [];
      fault.value = "";
      return;
    }
    const gone = new AbortController();
    const timer = setTimeout(() => {
      Promise.all(ids.map((id) => api.profile(id, lineText(line), further, gone.signal))).then(
        (profiles) => {
          if (gone.signal.aborted) return;
          found.value = profiles;
          fault.value = "";
        },
        (error: unknown) => {
          if (gone.signal.aborted) return;
          found.value = [];
          fault.value = said(error);
        },
      );
    }, PAUSE_MS);
    return () => {
      clearTimeout(timer);
      gone.abort();
    };
  });
  const present = mission.value;
  if (!present) return null;
  const ink = isDark.value ? DARK_INKS : INKS;
  const cuts: Cut[] = found.value.map((profile, i) => ({
    id: profile.mission_id,
    name: profile.name,
    colour: ink[i % MOST] as string,
    profile,
  }));
  const more = (missions.value ?? []).filter(({ id }) => id !== present.id && !others.value.includes(id));
  return (
    <div class="log profile" data-testid="profile">
      <div class="filters">
        <LineField line={measured.value ?? []} />
        {others.value.length < MOST - 1 ? (
          <Choice
            value=""
            label={say("profile.anotherSurvey")}
            options={[["", say("profile.anotherSurvey")], ...more.map(({ id, name }) => [id, name] as const)]}
            id="profile-add"
            onChoose={(id) => {
              if (id) others.value = [...others.value, id];
            }}
          />
        ) : null}
        <Choice
          value={layer.value}
          label={say("profile.furtherLayer")}
          options={[
            ["", say("profile.furtherLayer")],
            ...layers.value
              .filter(({ in_json, name }) => in_json && name !== "live")
              .map(({ name, title }) => [name, named("layer", name, title)] as const),
          ]}
          id="profile-layer"
          onChoose={into(layer)}
        />
        <Button
          id="profile-csv"
          disabled={cuts.length === 0}
          onClick={() => save("profile.csv", new Blob([csvOf(cuts)], { type: "text/csv" }))}
        >
          {say("profile.csv")}
        </Button>
      </div>
      <Trouble words={fault.value} />
      {cuts.length > 0 ? (
        <>
          <ul class="cuts">
            {cuts.map(({ id, name, colour, profile }) => (
              <li key={id}>
                <span class="swatch" style={{ background: colour }} /> {name}{" "}
                <small>{say("profile.soundings", { soundings: count(profile.soundings_found) })}</small>
                {others.value.includes(id) ? (
                  <Button
                    kind="tool small"
                    aria-label={say("profile.leaveOut", { name })}
                    onClick={() => {
                      others.value = others.value.filter((one) => one !== id);
                    }}
                  >
                    ✕
                  </Button>
                ) : null}
              </li>
            ))}
          </ul>
          <ProfileChart cuts={cuts} none_m={shownCertainty.value?.none_m ?? Infinity} />
          <Difference cuts={cuts} />
          {layer.value && cuts.every(({ profile }) => layer.value in profile.layers) ? (
            <LayerAlong cuts={cuts} layer={layer.value} />
          ) : null}
        </>
      ) : measured.value && measured.value.length > 1 ? null : (
        <p class="empty">{say("profile.drawALine")}</p>
      )}
    </div>
  );
}

/** The line in numbers, for those who cannot draw it. */
function LineField({ line }: { line: readonly LngLat[] }) {
  const wrong = useSignal(false);
  const shown = lineTyped(line);
  // What is being typed stays, whatever else of the page is drawn meanwhile.
  const text = useSignal(shown);
  // At once: later it would take away what was typed first.
  useLayoutEffect(() => {
    text.value = shown;
    wrong.value = false;
  }, [shown]);
  return (
    <label class="field line-field">
      <span class="visually-hidden">{say("profile.line")}</span>
      <input
        type="text"
        autocomplete="off"
        placeholder={say("profile.lineSample")}
        value={text.value}
        aria-invalid={wrong.value ? "true" : "false"}
        data-testid="profile-line"
        onInput={(event) => {
          text.value = event.currentTarget.value;
        }}
        onChange={(event) => {
          const corners = typedLine(event.currentTarget.value);
          wrong.value = corners === null;
          if (corners) measured.value = corners;
        }}
      />
      {wrong.value ? (
        <span class="fault" role="alert">
          ▲ {say("profile.noLine")}
        </span>
      ) : null}
    </label>
  );
}

/** How much deeper the later ones are than the first, where both know the bottom. */
function Difference({ cuts }: { cuts: readonly Cut[] }) {
  const [first, ...rest] = cuts;
  if (!first || rest.length === 0) return null;
  return (
    <ul class="small" data-testid="profile-difference">
      {rest.map(({ id, name, profile }) => {
        const both = differenceAlong(first.profile, profile).filter((one) => one !== null);
        const mean = both.reduce((sum, one) => sum + one, 0) / both.length;
        const largest = both.reduce((most, one) => (Math.abs(one) > Math.abs(most) ? one : most), 0);
        return (
          <li key={id}>
            {both.length === 0
              ? say("profile.nowhereBoth", { name, first: first.name })
              : say("profile.deeper", {
                  name,
                  first: first.name,
                  mean: metres(mean, 2),
                  largest: metres(largest, 2),
                })}
          </li>
        );
      })}
    </ul>
  );
}

/** A further layer's least, mean and largest value along the line. */
function LayerAlong({ cuts, layer }: { cuts: readonly Cut[]; layer: string }) {
  const title = named("layer", layer, layers.value.find(({ name }) => name === layer)?.title ?? layer);
  return (
    <ul class="small" data-testid="profile-layer-values">
      {cuts.map(({ id, name, profile }) => {
        const values = (profile.layers[layer] ?? []).filter((one) => one !== null);
        const mean = values.reduce((sum, one) => sum + one, 0) / values.length;
        return (
          <li key={id}>
            {values.length === 0
              ? say("profile.noValues", { name, title })
              : say("profile.values", {
                  name,
                  title,
                  least: short(Math.min(...values)),
                  mean: short(mean),
                  largest: short(Math.max(...values)),
                })}
          </li>
        );
      })}
    </ul>
  );
}

const short = (value: number) => plain(Number(value.toPrecision(3)));
