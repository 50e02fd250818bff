import { useSignal } from "@preact/signals";
import { say } from "../../words/say";
import { Button, Trouble, Typed } from "../parts/Controls";
import type { DrawingFile } from "./useDrawingFile";

/** What is wrong with a file of lines and areas, and what it has to be told; `id` is what it is for. */
export function DrawingQuestions({ of, id }: { of: DrawingFile; id: string }) {
  const crs = useSignal("");
  return (
    <>
      {of.busy ? (
        <Button id={`${id}-stop`} kind="link-button" onClick={of.stop}>
          {say("lines.stopReading")}
        </Button>
      ) : null}
      <Trouble words={of.fault} />
      {of.asksCrs ? (
        <div class="pair">
          <label class="field">
            {say("imports.crs")}
            <Typed text={crs} id={`${id}-crs`} placeholder={say("imports.crsExample")} />
          </label>
          <Button
            id={`${id}-read`}
            disabled={crs.value.trim() === ""}
            onClick={() => of.readIn(crs.value.trim())}
          >
            {say("lines.readIt")}
          </Button>
        </div>
      ) : null}
    </>
  );
}
