import { type Signal, useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import type { CastsView, CastView, NewCasts } from "../../api/types";
import { whyNotCommand } from "../../state/access";
import { type Cast, castsOf, timeOf, written } from "../../state/analysis/soundSpeedCast";
import { count, dayAndTimeUtc, fixed, latitude, longitude, metres, plain } from "../../state/format";
import { said } from "../../state/session";
import { selectedId } from "../../state/store";
import { say } from "../../words/say";
import { Button, Choice, FileButton, Typed } from "../parts/Controls";
import { numberOf, type PartProps } from "./correctionParts";
import { MeasuredCasts } from "./MeasuredCasts";

type Rule = CastsView["rule"];

const DISTANCE: Rule = "nearest_in_distance_within_time";

/** Rules by which pings find their cast, with their words. */
export const RULES: Record<Rule, () => string> = {
  nearest_in_time: () => say("casts.nearestInTime"),
  [DISTANCE]: () => say("casts.nearestInDistance"),
};

interface CastsProps extends PartProps {
  /** What is typed as the speed set in the sonars, for the first cast. */
  assumed: Signal<string>;
}

/** The sound speed casts with what each corrects; they are added, replaced and removed here. */
export function Casts({ found, busy, change, fault, assumed }: CastsProps) {
  const list = useSignal<CastsView | null>(null);
  const form = {
    name: useSignal(""),
    time: useSignal(""),
    lat: useSignal(""),
    lon: useSignal(""),
    text: useSignal(""),
    /** Where the text comes from; empty: it was typed. */
    source: useSignal(""),
  };
  useEffect(() => {
    const id = selectedId.peek();
    if (!id) return;
    let isNewest = true;
    api.casts(id).then(
      (casts) => {
        if (isNewest) list.value = casts;
      },
      (error) => {
        if (isNewest) fault.value = said(error);
      },
    );
    return () => {
      isNewest = false;
    };
  }, [found]);
  const show = (cast: Cast, name: string, source: string) => {
    form.name.value = name;
    form.time.value = cast.time ? typedTime(cast.time) : "";
    form.lat.value = cast.position ? plain(cast.position[1]) : "";
    form.lon.value = cast.position ? plain(cast.position[0]) : "";
    form.text.value = written(cast.profile);
    form.source.value = source;
  };
  const add = (casts: NewCasts["casts"]) => {
    const assumed_mps = found.sound_speed?.assumed_mps ?? numberOf(assumed);
    if (assumed_mps === null) fault.value = say("corrections.typeNumbers");
    else {
      // The speed set in the sonars comes with the first casts; later ones leave it, and what others added, as it is.
      const first = found.sound_speed ? {} : { assumed_mps };
      void change((id) => api.addCasts(id, { casts, ...first }));
    }
  };
  const casts = list.value?.casts ?? [];
  return (
    <section class="casts" data-testid="casts" aria-label={say("casts.casts")}>
      <h3>{say("casts.casts")}</h3>
      {casts.length ? <CastList casts={casts} busy={busy} change={change} show={show} /> : null}
      {list.value ? <Warnings list={list.value} /> : null}
      {casts.length > 1 && list.value ? (
        <RuleOf key={list.value.rule} list={list.value} busy={busy} change={change} fault={fault} />
      ) : null}
      <MeasuredCasts names={casts.map(({ name }) => name)} busy={busy} show={show} add={add} fault={fault} />
      <CastForm form={form} busy={busy} fault={fault} show={show} add={add} />
    </section>
  );
}

/** Puts a cast into the fields. */
export type Shown = (cast: Cast, name: string, source: string) => void;

/** Adds casts, or replaces those of the same names. */
export type Added = (casts: NewCasts["casts"]) => void;

/** A time, ISO 8601 in UTC, as it is typed: seconds where there are any. */
const typedTime = (time: string): string => time.slice(0, 19).replace("T", " ").replace(/:00$/, "");

interface ListProps extends Pick<CastsProps, "busy" | "change"> {
  casts: readonly CastView[];
  show: Shown;
}

function CastList({ casts, busy, change, show }: ListProps) {
  return (
    <ul>
      {casts.map((cast) => (
        <li key={cast.name} data-testid="cast">
          <span>
            <b>{cast.name}</b> {aboutCast(cast)}
          </span>
          <span class="row">
            <Button
              id="cast-change"
              onClick={() =>
                show({ ...cast, profile: cast.profile as Cast["profile"] }, cast.name, cast.source)
              }
            >
              {say("casts.change")}
            </Button>
            <Button
              id="cast-remove"
              commands
              busy={busy.value}
              onClick={() => void change((id) => api.deleteCast(id, cast.name))}
            >
              {say("casts.remove")}
            </Button>
          </span>
        </li>
      ))}
    </ul>
  );
}

/** When and where a cast was taken, how deep it went, and what it corrects. */
function aboutCast({ time, position, profile, soundings, pings, farthest_h }: CastView): string {
  const parts = [
    time ? dayAndTimeUtc(new Date(time)) : say("casts.noTime"),
    position ? `${latitude(position[1], 4)} ${longitude(position[0], 4)}` : "",
    say("casts.downTo", { depth: metres(profile.at(-1)?.[0]) }),
    say("casts.corrects", { soundings: count(soundings), pings: count(pings) }),
    farthest_h === null ? "" : say("casts.farthest", { hours: fixed(farthest_h, 1) }),
  ];
  return parts.filter((part) => part !== "").join(" · ");
}

/** Where casts are too few. */
function Warnings({ list }: { list: CastsView }) {
  const far = list.far_soundings + list.far_pings;
  const large = list.changes.filter((change) => change.is_large);
  return (
    <>
      {far ? (
        <p class="reason warning" data-testid="casts-far">
          {say("casts.far", { count: count(far), hours: plain(list.far_h) })}
        </p>
      ) : null}
      {large.map(({ before, after, difference_m }) => (
        <p class="reason warning" data-testid="casts-differ" key={`${before}/${after}`}>
          {say("casts.differ", {
            before,
            after,
            difference: metres(difference_m, 2),
            depth: metres(list.depth_m),
            limit: metres(list.limit_m, 2),
            order: list.order,
          })}
        </p>
      ))}
    </>
  );
}

interface RuleProps extends Pick<CastsProps, "busy" | "change" | "fault"> {
  list: CastsView;
}

function RuleOf({ list, busy, change, fault }: RuleProps) {
  const rule = useSignal<Rule>(list.rule);
  const hours = useSignal(plain(list.within_h));
  const apply = () => {
    const within_h = numberOf(hours);
    if (within_h === null) fault.value = say("corrections.typeNumbers");
    else void change((id) => api.setCastRule(id, { rule: rule.peek(), within_h }));
  };
  return (
    <>
      <div class="fields">
        <label class="field">
          {say("casts.rule")}
          <Choice
            id="casts-rule"
            value={rule.value}
            options={(Object.keys(RULES) as Rule[]).map((name) => [name, RULES[name]()])}
            onChoose={(chosen) => {
              rule.value = chosen;
            }}
          />
        </label>
        {rule.value === DISTANCE ? (
          <label class="field">
            {say("casts.withinHours")}
            <Typed text={hours} id="casts-hours" />
          </label>
        ) : null}
      </div>
      <p class="row">
        <Button id="casts-set-rule" commands busy={busy.value} onClick={apply}>
          {say("casts.applyRule")}
        </Button>
      </p>
    </>
  );
}

interface FormProps extends Pick<CastsProps, "busy" | "fault"> {
  form: Record<"name" | "time" | "lat" | "lon" | "text" | "source", Signal<string>>;
  show: Shown;
  add: Added;
}

function CastForm({ form, busy, fault, show, add }: FormProps) {
  const read = (name: string, text: string) => {
    const [cast, ...others] = castsOf(text);
    fault.value = cast ? "" : say("corrections.noProfile");
    if (!cast) return;
    show(cast, name, name);
    // Several sections stay as they are written, each with its own time and place.
    if (others.length) form.text.value = text;
  };
  const addTyped = () => {
    const casts = typedCasts(form);
    if (typeof casts === "string") fault.value = casts;
    else add(casts);
  };
  return (
    <>
      <div class="fields">
        <label class="field">
          {say("casts.name")}
          <Typed text={form.name} id="cast-name" maxLength={100} />
        </label>
        <label class="field">
          {say("casts.time")}
          <Typed text={form.time} id="cast-time" placeholder="2026-11-30 11:00" />
        </label>
        <label class="field">
          {say("casts.lat")}
          <Typed text={form.lat} id="cast-lat" />
        </label>
        <label class="field">
          {say("casts.lon")}
          <Typed text={form.lon} id="cast-lon" />
        </label>
      </div>
      <label class="field">
        {say("casts.text")}
        <textarea
          rows={3}
          data-testid="cast-text"
          value={form.text.value}
          onInput={(event) => {
            form.text.value = event.currentTarget.value;
            form.source.value = "";
          }}
        />
      </label>
      {whyNotCommand.value ? null : (
        <p class="row">
          <Button id="cast-add" commands busy={busy.value} onClick={addTyped}>
            {say("casts.add")}
          </Button>
          <FileButton accept=".asvp,.vel,.svp,.csv,.txt,.tsv" id="cast-file" onText={read}>
            {say("casts.file")}
          </FileButton>
        </p>
      )}
    </>
  );
}

/** What is typed, each cast with its name; words about what is wrong. Times and places that are typed count first. */
function typedCasts(form: FormProps["form"]): NewCasts["casts"] | string {
  const casts = castsOf(form.text.peek());
  const [first] = casts;
  if (!first) return say("corrections.noProfile");
  const name = form.name.peek().trim().replaceAll("/", "-");
  if (name === "") return say("casts.typeName");
  const source = form.source.peek() || name;
  if (casts.length > 1) return casts.map((cast, i) => ({ ...cast, name: `${name} ${i + 1}`, source }));
  const typed = form.time.peek().trim();
  const time = typed === "" ? first.time : timeOf(typed);
  if (typed !== "" && time === null) return say("casts.typeTime");
  const place = [form.lon, form.lat];
  if (place.every((field) => field.peek().trim() === "")) return [{ ...first, name, source, time }];
  const [lon, lat] = place.map(numberOf);
  if (lon == null || lat == null) return say("casts.typePlace");
  return [{ ...first, name, source, time, position: [lon, lat] }];
}
