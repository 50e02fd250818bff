import "./BottomStrip.css";
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { count, distance, metres, percent, plain } from "../../state/format";
import { shownStep } from "../../state/past/replay";
import { mission, replayStep, stripHeight, type Tab, tab, view } from "../../state/store";
import { say } from "../../words/say";
import { paneHeight } from "../chart/layout";
import { Imports } from "../imports/Imports";
import { Button } from "../parts/Controls";
import { Grip } from "../parts/Grip";
import { ProfilePane } from "../profile/ProfilePane";
import { Charts } from "./Charts";
import { Compare } from "./Compare";
import { Corrections } from "./Corrections";
import { EventLog } from "./EventLog";
import { Files } from "./Files";
import { Review } from "./Review";
import { TimeSlider } from "./TimeSlider";

export function BottomStrip() {
  const present = mission.value;
  const strip = useRef<HTMLElement>(null);
  useEffect(() => {
    const element = strip.current;
    if (!element) return;
    // Its lines wrap as the window says: what of the map it covers is measured.
    const watcher = new ResizeObserver(() => {
      if (tab.peek() === null) stripHeight.value = element.offsetHeight;
    });
    watcher.observe(element);
    return () => watcher.disconnect();
  }, [present === null]);
  if (!present) return null;
  const p = present.progress;
  const then = shownStep.value;
  const past = replayStep.value !== null;
  const figures = then?.figures ?? {};
  const coverage_pct = past ? (figures.coverage_pct ?? null) : p.coverage_pct;
  const mean_sd_m = past ? (figures.mean_sd_m ?? null) : p.mean_sd_m;
  const soundings = past ? (then?.soundings ?? null) : p.soundings;
  const distance_m = past ? (figures.distance_m ?? null) : p.distance_m;
  const newest = view.value.events.at(-1);
  return (
    <section ref={strip} class="bottom" aria-label={say("bottomStrip.progressAndLog")}>
      {tab.value === null ? null : (
        <Grip
          what={say("bottomStrip.thePane")}
          size={paneHeight}
          side="top"
          least={120}
          most={900}
          id="grip-pane"
        />
      )}
      {tab.value === "log" ? <EventLog /> : null}
      {tab.value === "files" ? <Files /> : null}
      {tab.value === "charts" ? <Charts /> : null}
      {tab.value === "soundings" ? <Review /> : null}
      {tab.value === "corrections" ? <Corrections /> : null}
      {tab.value === "imports" ? <Imports /> : null}
      {tab.value === "compare" ? <Compare /> : null}
      {tab.value === "profile" ? <ProfilePane /> : null}
      <TimeSlider />
      <div class="strip">
        <dl class="figures" data-past={past}>
          {p.search && !past ? (
            <>
              <Figure
                label={say("bottomStrip.goalAreaSeen")}
                value={percent(p.search.goal_pct, 1)}
                id="strip-goal"
              />
              <Figure
                label={say("bottomStrip.siteSeen")}
                value={percent(p.search.explored_pct, 1)}
                id="strip-site"
              />
            </>
          ) : p.search ? null : p.ensonified_pct !== null && !past ? (
            <>
              <Figure
                label={say("bottomStrip.ensonified")}
                value={percent(p.ensonified_pct, 1)}
                id="coverage"
              />
              <Figure label={say("bottomStrip.dense5AndMore")} value={percent(p.dense_pct, 1)} id="dense" />
              <Figure label={say("bottomStrip.holidays")} value={count(p.holidays ?? 0)} id="holidays" />
              <Figure label={say("bottomStrip.beams")} value={count(p.beams)} id="beams" />
            </>
          ) : (
            <>
              <Figure
                label={
                  p.ensonified_pct === null
                    ? say("bottomStrip.knownToM", { accuracyM: plain(present.spec.accuracy_m) })
                    : say("bottomStrip.ensonified")
                }
                value={percent(coverage_pct, 1)}
                id="coverage"
              />
              <Figure label={say("bottomStrip.meanDeviation")} value={metres(mean_sd_m, 2)} id="mean-sd" />
            </>
          )}
          {soundings === 0 && p.beams > 0 && !past ? null : (
            <Figure
              label={say("bottomStrip.soundings")}
              value={soundings === null ? "–" : count(soundings)}
              id="soundings"
            />
          )}
          <Figure
            label={say("bottomStrip.travelled")}
            value={distance_m === null ? "–" : distance(distance_m)}
            id="distance"
          />
        </dl>
        <nav class="tabs" aria-label={say("bottomStrip.moreAboutThisMission")}>
          <Toggle name="charts">{say("bottomStrip.charts")}</Toggle>
          <Toggle name="soundings">
            {say("bottomStrip.rejected", { it: p.rejected ? ` (${count(p.rejected)})` : "" })}
          </Toggle>
          {present.spec.kind === "survey" ? (
            <>
              <Toggle name="corrections">{say("corrections.corrections")}</Toggle>
              <Toggle name="imports">{say("imports.imports")}</Toggle>
            </>
          ) : null}
          <Toggle name="files">{say("bottomStrip.files")}</Toggle>
          <Toggle name="profile">{say("profile.profile")}</Toggle>
          <Toggle name="compare">{say("bottomStrip.compare")}</Toggle>
        </nav>
        <Button
          id="toggle-log"
          kind="log-toggle"
          aria-expanded={tab.value === "log"}
          onClick={() => toggle("log")}
        >
          <b>{say("bottomStrip.log", { it: tab.value === "log" ? "▾" : "▴" })}</b>{" "}
          <span class="newest">{newest?.message ?? say("bottomStrip.nothingYet")}</span>
        </Button>
      </div>
    </section>
  );
}

function toggle(name: Tab): void {
  tab.value = tab.value === name ? null : name;
}

function Toggle({ name, children }: { name: Tab; children: ComponentChildren }) {
  return (
    <Button id={`toggle-${name}`} aria-expanded={tab.value === name} onClick={() => toggle(name)}>
      {children} <span class="arrow">{tab.value === name ? "▾" : "▴"}</span>
    </Button>
  );
}

function Figure({ label, value, id }: { label: string; value: string; id: string }) {
  return (
    <div class="figure">
      <dt>{label}</dt>
      <dd data-testid={id}>{value}</dd>
    </div>
  );
}
