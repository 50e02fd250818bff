import "./Corrections.css";
import { useComputed, useSignal, useSignalEffect } from "@preact/signals";
import { useRef } from "preact/hooks";
import { api } from "../../api/client";
import SPEC from "../../api/mission.json";
import type { CorrectionsView } from "../../api/types";
import { whyNotCommand } from "../../state/access";
import { type Cast, castsOf } from "../../state/analysis/soundSpeedCast";
import { profileEnds } from "../../state/analysis/soundSpeedProfile";
import { count, dayAndTime, plain } from "../../state/format";
import { said } from "../../state/session";
import { selectedId, view } from "../../state/store";
import { say } from "../../words/say";
import { Button, FileButton, Trouble, Typed } from "../parts/Controls";
import { Casts, RULES } from "./Casts";
import { type Change, numberOf, type PartProps } from "./correctionParts";
import { Mountings } from "./Mountings";

/** How soundings are corrected for tide and sound speed, and how that is changed, also when all was flown long ago. */
export function Corrections() {
  const answer = useSignal<CorrectionsView | null>(null);
  const busy = useSignal(false);
  const fault = useSignal("");
  /** How often was asked, and which answer is shown: one that was asked for earlier may come later. */
  const numbers = useRef({ asked: 0, shown: 0 });
  const ask = async (id: string, asked: Parameters<Change>[0]) => {
    const number = ++numbers.current.asked;
    const found = await asked(id);
    if (selectedId.peek() !== id || number < numbers.current.shown) return;
    numbers.current.shown = number;
    answer.value = found;
  };
  const change: Change = async (asked) => {
    const id = selectedId.peek();
    if (!id) return;
    busy.value = true;
    fault.value = "";
    try {
      await ask(id, asked);
    } catch (error) {
      if (selectedId.peek() === id) fault.value = said(error);
    } finally {
      busy.value = false;
    }
  };
  useSignalEffect(() => {
    selectedId.value;
    answer.value = null;
    void change(api.corrections);
  });
  // What others change is shown, too.
  const changed = useComputed(() => view.value.events.findLast(({ kind }) => kind === "corrections")?.id);
  const seen = useRef(changed.peek());
  useSignalEffect(() => {
    const id = selectedId.peek();
    if (!id || changed.value === seen.current) return;
    seen.current = changed.value;
    ask(id, api.corrections).catch((error: unknown) => {
      if (selectedId.peek() === id) fault.value = said(error);
    });
  });
  const found = answer.value;
  return (
    <div class="log corrections" data-testid="corrections">
      <Trouble words={fault.value} />
      {found ? (
        <>
          <p class="hint" data-testid="corrections-datum">
            {say("corrections.depthsFrom", {
              datum: found.vertical_datum,
              accepted: count(found.accepted),
              rejected: count(found.rejected),
            })}
          </p>
          <div class="parts" key={selectedId.value}>
            <WaterLevel found={found} busy={busy} change={change} fault={fault} />
            <SoundSpeed found={found} busy={busy} change={change} fault={fault} />
            <Mountings found={found} busy={busy} change={change} fault={fault} />
          </div>
          <p class="hint">{say("corrections.everySoundingAnew")}</p>
        </>
      ) : null}
    </div>
  );
}

function WaterLevel({ found, busy, change, fault }: PartProps) {
  const { tide, tide_table: table } = found;
  const level = useSignal(plain(tide.level_m));
  const sd = useSignal(plain(tide.sd_m));
  const isNamed = !table && tide.source !== SPEC["tide.source"].default;
  const source = useSignal(isNamed ? tide.source : "");
  const stated = () => {
    const [level_m, sd_m] = [numberOf(level), numberOf(sd)];
    if (level_m === null || sd_m === null) {
      fault.value = say("corrections.typeNumbers");
      return;
    }
    const from = source.peek().trim() || say("draft.statedByTheOperator");
    void change((id) => api.setTide(id, { ...tide, level_m, sd_m, source: from }));
  };
  const read = (name: string, text: string) =>
    void change((id) =>
      api.setTide(id, {
        ...tide,
        sd_m: numberOf(sd) ?? tide.sd_m,
        table: text,
        table_name: name,
        source: name,
      }),
    );
  return (
    <section aria-label={say("corrections.waterLevel")}>
      <h3>{say("corrections.waterLevel")}</h3>
      <p data-testid="corrections-tide">
        {table
          ? say("corrections.table", {
              name: table.name,
              entries: count(table.entries),
              first: dayAndTime(new Date(table.first)),
              last: dayAndTime(new Date(table.last)),
            })
          : say("corrections.level", { level: plain(tide.level_m), source: tide.source })}
      </p>
      <div class="fields">
        <label class="field">
          {say("corrections.levelM")}
          <Typed text={level} id="corrections-level" />
        </label>
        <label class="field">
          {say("corrections.deviationM")}
          <Typed text={sd} id="corrections-tide-sd" />
        </label>
        <label class="field">
          {say("mission.fromWhere")}
          <Typed
            text={source}
            id="corrections-tide-source"
            placeholder={say("mission.gauge")}
            maxLength={200}
          />
        </label>
      </div>
      <p class="row">
        <Button id="corrections-set-level" commands busy={busy.value} onClick={stated}>
          {say(table ? "corrections.applyLevelInstead" : "corrections.applyLevel")}
        </Button>
        {whyNotCommand.value ? null : (
          <FileButton accept=".tid,.txt,.csv,.tsv" id="corrections-tide-file" onText={read}>
            {say("corrections.tideTable")}
          </FileButton>
        )}
      </p>
    </section>
  );
}

/** "low – high", or the one that both are. */
const between = (ends: readonly [number, number]): string => [...new Set(ends.map(plain))].join(" – ");

function SoundSpeed({ found, busy, change, fault }: PartProps) {
  const speed = found.sound_speed;
  const assumed = useSignal(plain(speed?.assumed_mps ?? SPEC["sound_speed.assumed_mps"].default));
  const everywhere = useSignal("");
  const ends = speed ? profileEnds(speed.profile) : null;
  const apply = (cast: Partial<Cast>, source: string) => {
    const assumed_mps = numberOf(assumed);
    const { profile = [] } = cast;
    if (assumed_mps === null || profile.length === 0) {
      fault.value = say(assumed_mps === null ? "corrections.typeNumbers" : "corrections.noProfile");
      return;
    }
    void change((id) => api.setSoundSpeed(id, { ...cast, assumed_mps, profile, source }));
  };
  const one = () => {
    const mps = numberOf(everywhere);
    if (mps === null) fault.value = say("corrections.typeNumbers");
    else apply({ profile: [[0, mps]] }, say("draft.statedByTheOperator"));
  };
  // Of a file of several sections the one with most depths, as of any other.
  const longest = (text: string): Partial<Cast> =>
    castsOf(text).reduce<Partial<Cast>>(
      (most, cast) => (cast.profile.length > (most.profile?.length ?? 0) ? cast : most),
      {},
    );
  const isSeveral = !!speed?.further.length;
  return (
    <>
      <section aria-label={say("corrections.soundSpeed")}>
        <h3>{say("corrections.soundSpeed")}</h3>
        <p data-testid="corrections-sound-speed">
          {isSeveral
            ? say("corrections.severalCasts", {
                count: count(1 + speed.further.length),
                rule: RULES[speed.rule](),
                assumed: plain(speed.assumed_mps),
              })
            : speed && ends
              ? say("corrections.profile", {
                  depths: between(ends.depths),
                  speeds: between(ends.speeds),
                  count: count(speed.profile.length),
                  assumed: plain(speed.assumed_mps),
                  source: speed.source,
                })
              : say("corrections.ownRanges")}
        </p>
        <div class="fields">
          <label class="field">
            {say("corrections.setInTheSonars")}
            <Typed text={assumed} id="corrections-assumed" />
          </label>
          <label class="field">
            {say("corrections.sameEverywhere")}
            <Typed text={everywhere} id="corrections-speed" />
          </label>
        </div>
        <p class="row">
          <Button id="corrections-set-speed" commands busy={busy.value} onClick={one}>
            {say("corrections.applySpeed")}
          </Button>
          {whyNotCommand.value ? null : (
            <FileButton
              accept=".asvp,.vel,.svp,.csv,.txt,.tsv"
              id="corrections-profile-file"
              onText={(name, text) => apply(longest(text), name)}
            >
              {say(isSeveral ? "corrections.profileFileInstead" : "corrections.profileFile")}
            </FileButton>
          )}
          {speed ? (
            <Button
              id="corrections-remove-speed"
              commands
              busy={busy.value}
              onClick={() => void change(api.deleteSoundSpeed)}
            >
              {say("corrections.remove")}
            </Button>
          ) : null}
        </p>
      </section>
      <Casts found={found} busy={busy} change={change} fault={fault} assumed={assumed} />
    </>
  );
}
