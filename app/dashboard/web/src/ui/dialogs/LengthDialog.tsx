import "./LengthDialog.css";
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api, ServiceError } from "../../api/client";
import type { Budget } from "../../api/types";
import { plain, pointed } from "../../state/format";
import { said } from "../../state/session";
import { lengthWords } from "../../state/stateNames";
import { lengthOpen, mission } from "../../state/store";
import { say } from "../../words/say";
import { Button, Choice, into, sets, Typed } from "../parts/Controls";
import { Dialog } from "../parts/Dialog";

type Unit = keyof Budget;

const FORM = "length-form";

/** What a mission's length may be told in. */
const units = (): readonly (readonly [Unit, string])[] => [
  ["minutes", say("fields.minutes")],
  ["km_per_vehicle", say("fields.kmPerVehicle")],
  ["steps", say("fields.steps")],
];

/** Makes a mission that is under way longer or shorter. */
export function LengthDialog() {
  const present = mission.value;
  const open = lengthOpen.value;
  const unit = useSignal<Unit>("minutes");
  const text = useSignal("");
  const fault = useSignal("");
  const sending = useSignal(false);
  useEffect(() => {
    const budget = mission.peek()?.progress.budget;
    const [name] = units().find(([one]) => budget?.[one] != null) ?? ["minutes" as const];
    unit.value = name;
    text.value = budget?.[name] == null ? "" : plain(budget[name] as number);
    fault.value = "";
  }, [open]);
  const change = async (event: Event) => {
    event.preventDefault();
    const value = Number(pointed(text.value.trim()));
    if (!present || sending.value) return;
    if (text.value.trim() === "" || Number.isNaN(value)) {
      fault.value = say("length.typeANumber", { example: 80 });
      return;
    }
    sending.value = true;
    try {
      await api.setBudget(present.id, { [unit.value]: value });
      lengthOpen.value = false;
    } catch (error) {
      fault.value = words(error);
    } finally {
      sending.value = false;
    }
  };
  return (
    <Dialog
      open={open}
      onClose={sets(lengthOpen, false)}
      name="length"
      kind="length"
      heading={say("length.howLong", { name: present?.name ?? "" })}
      fault={fault.value}
      actions={
        <Button id="set-length" kind="command primary" commands busy={sending.value} form={FORM}>
          {sending.value ? say("length.setting") : say("length.set")}
        </Button>
      }
    >
      <p>
        {present ? say("length.countsFromTheBeginning", { progress: lengthWords(present.progress) }) : ""}
      </p>
      <form id={FORM} class="length-form" onSubmit={(event) => void change(event)}>
        <label class="field">
          {say("length.length")}
          <Typed text={text} label={say("length.length")} id="length-value" />
        </label>
        <label class="field">
          {say("length.unit")}
          <Choice
            value={unit.value}
            options={units()}
            onChoose={into(unit)}
            label={say("length.unit")}
            id="length-unit"
          />
        </label>
      </form>
    </Dialog>
  );
}

/** What is wrong with a length, and what would be right. */
function words(error: unknown): string {
  const [first] = error instanceof ServiceError ? error.faults : [];
  return first ? [first.message, first.expected].filter(Boolean).join(". ") : said(error);
}
