import "./SoundingsInSpace.css";
import { effect, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { SoundingState } from "../../api/types";
import { colourAt, DEPTH_PALETTES, type Palette } from "../../map/picture/palette";
import type { SeaFloorScene } from "../../map/space/scene";
import {
  beamArea,
  beams,
  doneEdits,
  forgetBeams,
  groundRound,
  loadBeams,
  ruleChosenBeams,
  takeBackEdit,
} from "../../state/analysis/beamCloud";
import {
  type Cloud,
  chosenPoints,
  cloud,
  donePoints,
  forgetCloud,
  loadCloud,
  MOST_POINTS,
  type Ruling,
  refusedPoints,
  ruleChosen,
  takeBack,
} from "../../state/analysis/cloud";
import { count } from "../../state/format";
import { said } from "../../state/session";
import { depthPalette, isDark, mission, rangeOf, selectedId } from "../../state/store";
import { say } from "../../words/say";
import { Button, flips, Typed } from "../parts/Controls";
import { Lasso } from "./Lasso";

type Colour = readonly [red: number, green: number, blue: number];
const CHOSEN: Colour = [1, 0.1, 0.9];
/** What is simply used has the colour of its depth. */
const COLOURS: Partial<Record<SoundingState, Colour>> = {
  rejected: [0.88, 0.27, 0.18],
  withdrawn: [0.45, 0.45, 0.45],
  doubted: [1, 0.82, 0.3],
  restored: [0.3, 0.85, 0.35],
};

/** So much light has at least what has the colour of its depth before a dark ground: deep water is nearly black. */
const LEAST_LIGHT = 0.12;

/** Colours in space are mixed as light is. */
const linear = (part: number, least: number) => least + (1 - least) * (part / 255) ** 2.2;

interface DepthColours {
  palette: Palette;
  low: number;
  high: number;
  leastLight: number;
}

function coloursOf(points: Cloud, chosen: readonly number[], by: DepthColours) {
  const colours = new Float32Array(3 * points.id.length);
  points.state.forEach((state, i) => {
    const own = COLOURS[state];
    if (own)
      colours.set(
        own.map((part) => part ** 2.2),
        3 * i,
      );
    else {
      const colour = colourAt(by.palette, points.depth_m[i] as number, by.low, by.high);
      colours.set(
        colour.map((part) => linear(part, by.leastLight)),
        3 * i,
      );
    }
  });
  for (const i of chosen)
    colours.set(
      CHOSEN.map((part) => part ** 2.2),
      3 * i,
    );
  return colours;
}

/**
 * All soundings as points in space, or the beams of swath sonars; a lasso, or a frame moved by the keyboard, chooses some
 * to be decided about.
 */
export function SoundingsInSpace({ scene }: { scene: SeaFloorScene }) {
  const fault = useSignal("");
  const busy = useSignal(false);
  const note = useSignal("");
  const floor = useSignal(false);
  const lasso = useSignal(true);
  const id = selectedId.value ?? "";
  const { pings = 0, soundings = 0 } = mission.value?.progress ?? {};
  const single = useSignal(pings === 0);
  const gone = useRef(new AbortController());

  const read = () => {
    gone.current.abort();
    gone.current = new AbortController();
    const { signal } = gone.current;
    const loading = single.peek() ? loadCloud(id, signal) : loadBeams(id, signal);
    loading.catch((error: unknown) => {
      if (!signal.aborted) fault.value = said(error);
    });
  };
  const readAnew = () => {
    forgetCloud();
    beams.value = null;
    fault.value = "";
    read();
  };
  useEffect(() => {
    readAnew();
    let drawn = 0;
    const stops = [
      effect(() => {
        const points = cloud.value;
        if ((points?.id.length ?? 0) !== drawn) scene.setSoundings(points);
        drawn = points?.id.length ?? 0;
        const range = rangeOf("depth");
        if (!points || !range) return;
        const { palette } = DEPTH_PALETTES[depthPalette.value];
        const leastLight = isDark.value ? LEAST_LIGHT : 0;
        scene.colourSoundings(coloursOf(points, chosenPoints.value, { palette, ...range, leastLight }));
      }),
      effect(() => scene.setFloorShown(floor.value)),
    ];
    return () => {
      gone.current.abort();
      for (const stop of stops) stop();
      forgetCloud();
      forgetBeams();
      scene.setSoundings(null);
      scene.setFloorShown(true);
    };
  }, [scene, id]);

  const act = async (what: () => Promise<void>) => {
    if (busy.value) return;
    busy.value = true;
    fault.value = "";
    try {
      await what();
      note.value = "";
    } catch (error) {
      fault.value = said(error);
    } finally {
      busy.value = false;
    }
  };
  const rule = (ruling: Ruling) =>
    void act(() => (single.peek() ? ruleChosen : ruleChosenBeams)(id, ruling, note.value.trim()));
  const undo = () =>
    void act(() => (single.peek() ? takeBack(id, note.value.trim()) : takeBackEdit(id, gone.current.signal)));
  const points = cloud.value;
  const chosen = chosenPoints.value.length;
  /** Of so many pings one is shown: those between them would stay. */
  const every = single.value ? 1 : (beams.value?.every ?? 1);
  const done = single.value ? donePoints.value.length : doneEdits.value.length;
  return (
    <>
      {lasso.value ? (
        <Lasso
          scene={scene}
          onReject={() => {
            if (every === 1) rule("reject");
          }}
          onUndo={undo}
        />
      ) : null}
      <div class="points-tools" data-testid="points">
        <p role="status" data-testid="points-chosen">
          {points === null
            ? say("space.soundingsAreRead")
            : chosen > 0
              ? say(single.value ? "space.chosenOf" : "space.chosenOfBeams", {
                  chosen: count(chosen),
                  all: count(points.id.length),
                })
              : say(single.value ? "space.drawRound" : "space.drawRoundBeams", {
                  all: count(points.id.length),
                })}
          {points && every > 1 ? ` ${say("space.everyPing", { every, total: count(points.total) })}` : ""}
          {single.value && points && points.total > points.id.length && points.id.length >= MOST_POINTS
            ? ` ${say("space.onlyTheFirst", { total: count(points.total) })}`
            : ""}
        </p>
        <div class="buttons">
          <Button
            id="points-reject"
            kind="command primary"
            commands
            disabled={chosen === 0 || every > 1}
            busy={busy.value}
            onClick={() => rule("reject")}
          >
            {say("review.reject")}
          </Button>
          <Button
            id="points-restore"
            commands
            disabled={chosen === 0 || every > 1}
            busy={busy.value}
            onClick={() => rule("restore")}
          >
            {say("review.restore")}
          </Button>
          <Button id="points-undo" commands disabled={done === 0} busy={busy.value} onClick={undo}>
            {say("space.undo")}
          </Button>
          {single.value ? null : (
            <>
              <Button
                id="beams-here"
                disabled={chosen === 0}
                onClick={() => {
                  if (beams.value) beamArea.value = groundRound(beams.value, chosenPoints.value);
                  readAnew();
                }}
              >
                {say("space.allBeamsHere")}
              </Button>
              <Button
                id="beams-everywhere"
                disabled={!beamArea.value}
                onClick={() => {
                  beamArea.value = null;
                  readAnew();
                }}
              >
                {say("space.wholeSurvey")}
              </Button>
            </>
          )}
          {pings > 0 && soundings > 0 ? (
            <Button
              id="single-beams"
              aria-pressed={single.value}
              onClick={() => {
                single.value = !single.value;
                readAnew();
              }}
            >
              {say("space.singleBeams")}
            </Button>
          ) : null}
          <Button id="toggle-lasso" aria-pressed={lasso.value} onClick={flips(lasso)}>
            {say("space.lasso")}
          </Button>
          <Button aria-pressed={floor.value} onClick={flips(floor)} id="points-floor">
            {say("space.seaFloor")}
          </Button>
          <Typed
            text={note}
            label={say("review.whyKeptInTheLog")}
            placeholder={say("review.whyKeptInTheLog2")}
            maxLength={500}
            id="points-note"
          />
        </div>
        <Key />
        {refusedPoints.value ? (
          <p class="reason warning" role="alert">
            {say("space.notRestored", {
              count: count(refusedPoints.value.count),
              reason: refusedPoints.value.reason,
            })}
          </p>
        ) : null}
        {fault.value ? (
          <p class="reason alarm" role="alert">
            {fault.value}
          </p>
        ) : null}
      </div>
    </>
  );
}

/** What the colours mean. */
function Key() {
  const words: Record<string, string> = {
    doubted: say("review.leftOutByTheMap"),
    rejected: say("review.keptOutByTheGate"),
    withdrawn: say("review.keptOutByAnOperator"),
    restored: say("review.restored"),
  };
  return (
    <p class="points-key">
      {Object.entries(words).map(([state, text]) => (
        <span key={state}>
          <i style={{ background: css(COLOURS[state as SoundingState] as Colour) }} aria-hidden="true" />{" "}
          {text}
        </span>
      ))}
      <span>
        <i style={{ background: css(CHOSEN) }} aria-hidden="true" /> {say("space.chosen")}
      </span>
    </p>
  );
}

const css = (colour: Colour) => `rgb(${colour.map((part) => Math.round(part * 255)).join(" ")})`;
