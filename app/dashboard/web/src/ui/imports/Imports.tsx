import "./Imports.css";
import { selectedId } from "../../state/store";
import { say } from "../../words/say";
import { Logs } from "./Logs";
import { Priors } from "./Priors";
import { Reference } from "./Reference";

/** What reaches the mission as a file: vehicles' own logs, depths to begin with, and a grid to compare with. */
export function Imports() {
  return (
    <div class="log imports" data-testid="imports">
      <div class="parts" key={selectedId.value}>
        <Logs />
        <Priors />
        <Reference />
      </div>
      <p class="hint">{say("imports.formats")}</p>
    </div>
  );
}
