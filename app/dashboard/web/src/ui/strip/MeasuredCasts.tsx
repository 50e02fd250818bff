import { type Signal, useComputed, useSignal, useSignalEffect } from "@preact/signals";
import { api } from "../../api/client";
import type { VehicleCastView } from "../../api/types";
import type { Cast } from "../../state/analysis/soundSpeedCast";
import { count, dayAndTimeUtc, fixed, metres } from "../../state/format";
import { said } from "../../state/session";
import { selectedId, view } from "../../state/store";
import { say } from "../../words/say";
import { Button } from "../parts/Controls";
import { CastChart } from "./CastChart";
import type { Added, Shown } from "./Casts";

/** What vehicles send is looked at again after this time; logs are when they were imported. */
const AGAIN_MS = 60_000;

/** From this difference on the service takes only the way down, m/s. */
const LAGS_MPS = 0.5;

interface Props {
  /** Of the casts that count. */
  names: readonly string[];
  busy: Signal<boolean>;
  show: Shown;
  add: Added;
  fault: Signal<string>;
}

/** What vehicles measured of the sound's speed on their way: it is added as a cast, or filled in to be changed before. */
export function MeasuredCasts({ names, busy, show, add, fault }: Props) {
  const found = useSignal<readonly VehicleCastView[]>([]);
  // Logs are imported, and taken back, meanwhile.
  const changed = useComputed(() => view.value.events.findLast(({ kind }) => kind === "import")?.id);
  useSignalEffect(() => {
    const id = selectedId.value;
    changed.value;
    if (!id) return;
    const look = () =>
      void api.measuredCasts(id).then(
        (casts) => {
          if (selectedId.peek() === id) found.value = casts;
        },
        (error: unknown) => {
          if (selectedId.peek() === id) fault.value = said(error);
        },
      );
    look();
    const timer = setInterval(look, AGAIN_MS);
    return () => clearInterval(timer);
  });
  if (found.value.length === 0) return null;
  return (
    <>
      <h4>{say("casts.measured")}</h4>
      <ul>
        {found.value.map((cast) => (
          <li key={`${cast.vehicle} ${cast.time}`} data-testid="measured-cast">
            <span>
              <b>{cast.vehicle}</b> {about(cast)}
            </span>
            <span class="row">
              {names.includes(nameOf(cast)) ? null : (
                <Button
                  id="cast-add-measured"
                  commands
                  busy={busy.value}
                  onClick={() => add([{ ...castOf(cast), name: nameOf(cast), source: sourceOf(cast) }])}
                >
                  {say("casts.addMeasured")}
                </Button>
              )}
              <Button id="cast-fill-in" onClick={() => show(castOf(cast), nameOf(cast), sourceOf(cast))}>
                {say("casts.fillIn")}
              </Button>
            </span>
            <details data-testid="cast-profile">
              <summary>{say("casts.profile")}</summary>
              <CastChart cast={cast} />
            </details>
          </li>
        ))}
      </ul>
    </>
  );
}

const castOf = ({ time, position, profile }: VehicleCastView): Cast => ({
  time,
  position,
  profile: profile as Cast["profile"],
});

const nameOf = ({ vehicle, time }: VehicleCastView): string =>
  `${vehicle} ${time.slice(0, 16).replace("T", " ")}`;

/** The log, or what measured it, as the source of a cast. */
const sourceOf = ({ vehicle, file, probe }: VehicleCastView): string =>
  file ?? [vehicle, probe].filter(Boolean).join(" ");

/** When it was measured, how deep it goes, and how well single speeds agree. */
const about = ({ time, file, profile, sd_mps, samples, lag_mps }: VehicleCastView): string =>
  [
    dayAndTimeUtc(new Date(time)),
    say("casts.downTo", { depth: metres(profile.at(-1)?.[0]) }),
    say("casts.speeds", { samples: count(samples), sd: fixed(sd_mps, 1) }),
    lag_mps != null && Math.abs(lag_mps) > LAGS_MPS
      ? say("casts.lags", { lag: fixed(Math.abs(lag_mps), 1) })
      : "",
    file ?? say("casts.sent"),
  ]
    .filter((part) => part !== "")
    .join(" · ");
