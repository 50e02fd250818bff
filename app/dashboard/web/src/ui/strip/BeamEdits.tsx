import { useComputed, useSignal, useSignalEffect } from "@preact/signals";
import { api } from "../../api/client";
import type { BeamEditsView, BeamEditView, BeamSelection } from "../../api/types";
import { count, dayAndTime, metres, plain } from "../../state/format";
import { said } from "../../state/session";
import { mission, selectedId, view } from "../../state/store";
import { say } from "../../words/say";
import { Button, Choice, into, Trouble, Typed } from "../parts/Controls";
import { numberOf } from "./correctionParts";

/** What was said of beams of swath sonars, which can be taken back, and more to be said of all that have something in common. */
export function BeamEdits() {
  const found = useSignal<BeamEditsView | null>(null);
  const fault = useSignal("");
  const busy = useSignal(false);
  // What others say, and what is said in space, is shown, too.
  const changed = useComputed(() => view.value.events.findLast(({ kind }) => kind === "sounding")?.id);
  const act = async (what: (id: string) => Promise<unknown>) => {
    const id = selectedId.peek();
    if (!id || busy.peek()) return;
    busy.value = true;
    fault.value = "";
    try {
      await what(id);
      const now = await api.beamEdits(id);
      if (selectedId.peek() === id) found.value = now;
    } catch (error) {
      if (selectedId.peek() === id) fault.value = said(error);
    } finally {
      busy.value = false;
    }
  };
  useSignalEffect(() => {
    const id = selectedId.value;
    changed.value;
    if (!id) return;
    api.beamEdits(id).then(
      (now) => {
        if (selectedId.peek() === id) found.value = now;
      },
      (error: unknown) => {
        if (selectedId.peek() === id) fault.value = said(error);
      },
    );
  });
  const edits = found.value;
  if (!edits) return <Trouble words={fault.value} />;
  return (
    <section class="beam-edits" data-testid="beam-edits" aria-label={say("beams.beams")}>
      <h3>{say("beams.beams")}</h3>
      <p class="hint">
        {say("beams.outAndIn", { rejected: count(edits.rejected), restored: count(edits.restored) })}{" "}
        {say("beams.chooseInSpace")}
      </p>
      <Trouble words={fault.value} />
      <ol>
        {edits.edits.map((edit) => (
          <li key={edit.id} data-testid={`beam-edit-${edit.id}`}>
            <b>{count(edit.beams)}</b>
            <span class="message">{described(edit)}</span>
            <Button
              id={`withdraw-${edit.id}`}
              commands
              busy={busy.value}
              onClick={() => void act((id) => api.withdrawBeamEdit(id, edit.id))}
            >
              {say("beams.takeBack")}
            </Button>
          </li>
        ))}
      </ol>
      <InCommon busy={busy.value} fault={fault} act={act} />
    </section>
  );
}

function described({ ruling, vehicles, selection, made_at, actor, note }: BeamEditView): string {
  const words = [
    say(ruling === "rejected" ? "beams.rejected" : "beams.restored"),
    vehicles.join(", "),
    ...(selection ? limits(selection) : []),
    `${dayAndTime(new Date(made_at))}, ${actor}`,
    ...(note ? [note] : []),
  ];
  return words.join(" · ");
}

function limits(selection: BeamSelection): string[] {
  const { least_angle_deg, most_depth_m, least_depth_m, area, from_s, until_s } = selection;
  return [
    ...(least_angle_deg != null ? [say("beams.beyondAngle", { angle: plain(least_angle_deg) })] : []),
    ...(most_depth_m != null ? [say("beams.shoalerThan", { depth: metres(most_depth_m, 2) })] : []),
    ...(least_depth_m != null ? [say("beams.deeperThan", { depth: metres(least_depth_m, 2) })] : []),
    ...(from_s != null || until_s != null ? [say("beams.ofTimes")] : []),
    ...(area ? [say("beams.inAnArea")] : []),
  ];
}

interface InCommonProps {
  busy: boolean;
  fault: { value: string };
  act: (what: (id: string) => Promise<unknown>) => Promise<void>;
}

/** Beams by vehicle, angle and depth, all at once. */
function InCommon({ busy, fault, act }: InCommonProps) {
  const vehicle = useSignal("");
  const [angle, shoaler, deeper, note] = [useSignal(""), useSignal(""), useSignal(""), useSignal("")];
  const names = mission.value?.vehicles.map(({ name }) => name) ?? [];
  const rule = (ruling: "reject" | "restore") => {
    const selection: BeamSelection = {};
    if (vehicle.peek()) selection.vehicle = vehicle.peek();
    for (const [text, name] of [
      [angle, "least_angle_deg"],
      [shoaler, "most_depth_m"],
      [deeper, "least_depth_m"],
    ] as const) {
      if (text.peek().trim() === "") continue;
      const value = numberOf(text);
      if (value === null) {
        fault.value = say("corrections.typeNumbers");
        return;
      }
      selection[name] = value;
    }
    if (Object.keys(selection).length === 0) {
      fault.value = say("beams.stateSomething");
      return;
    }
    void act(async (id) => {
      await api.ruleBeams(id, ruling, { selection }, note.peek().trim());
      note.value = "";
    });
  };
  return (
    <details data-testid="beams-in-common">
      <summary>{say("beams.allThat")}</summary>
      <div class="fields">
        <label class="field">
          {say("beams.ofVehicle")}
          <Choice
            value={vehicle.value}
            label={say("beams.ofVehicle")}
            options={[["", say("beams.anyVehicle")], ...names.map((name) => [name, name] as const)]}
            id="beams-vehicle"
            onChoose={into(vehicle)}
          />
        </label>
        <label class="field">
          {say("beams.leastAngle")}
          <Typed text={angle} id="beams-angle" />
        </label>
        <label class="field">
          {say("beams.shoalerThanM")}
          <Typed text={shoaler} id="beams-shoaler" />
        </label>
        <label class="field">
          {say("beams.deeperThanM")}
          <Typed text={deeper} id="beams-deeper" />
        </label>
        <label class="field">
          {say("review.whyKeptInTheLog")}
          <Typed text={note} id="beams-note" maxLength={500} />
        </label>
      </div>
      <p class="row">
        <Button id="beams-reject" commands busy={busy} onClick={() => rule("reject")}>
          {say("review.reject")}
        </Button>
        <Button id="beams-restore" commands busy={busy} onClick={() => rule("restore")}>
          {say("review.restore")}
        </Button>
      </p>
    </details>
  );
}
