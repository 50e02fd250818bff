import "./BlockFields.css";
import { sizeOf } from "../../map/area";
import { atBlock, earlier, renamed, withAnother, withoutBlock } from "../../state/form/blocks";
import { allBlocks, blockTitle } from "../../state/form/draft";
import { fixed } from "../../state/format";
import { say } from "../../words/say";
import { Button } from "../parts/Controls";
import { Fault, useForm } from "./Fields";

/** Several areas, flown one after the other: which of them the fields describe, their names and their order. */
export function BlockFields() {
  const { draft, set } = useForm();
  const all = allBlocks(draft);
  return (
    <fieldset class="blocks" data-testid="blocks">
      <legend>{say("blocks.blocks")}</legend>
      {all.length > 1 ? (
        <>
          <p class="hint">{say("blocks.flownInThisOrder")}</p>
          <ol>
            {all.map((block, i) => (
              <li key={i} class="field">
                <Button
                  id={`block-${i + 1}`}
                  kind="tool small"
                  aria-pressed={i === draft.turn}
                  aria-label={say("blocks.describe", { i: i + 1, name: blockTitle(block, i) })}
                  title={say("blocks.describe", { i: i + 1, name: blockTitle(block, i) })}
                  onClick={() => set(atBlock(draft, i))}
                >
                  {i + 1}
                </Button>
                <input
                  type="text"
                  autocomplete="off"
                  maxLength={60}
                  value={block.name}
                  placeholder={blockTitle({ name: "" }, i)}
                  aria-label={say("blocks.nameOf", { i: i + 1 })}
                  data-testid={`block-name-${i + 1}`}
                  onInput={({ currentTarget }) => set(renamed(draft, i, currentTarget.value))}
                />
                <span class="size">
                  {block.ring.length > 2
                    ? say("blocks.ha", { area: fixed(sizeOf(block.ring).area_m2 / 1e4, 2) })
                    : say("blocks.notDrawn")}
                </span>
                <Button
                  id={`block-earlier-${i + 1}`}
                  kind="tool small"
                  disabled={i === 0}
                  aria-label={say("blocks.earlier", { name: blockTitle(block, i) })}
                  onClick={() => set(earlier(draft, i))}
                >
                  ↑
                </Button>
                <Button
                  id={`block-remove-${i + 1}`}
                  kind="tool small"
                  aria-label={say("blocks.remove", { name: blockTitle(block, i) })}
                  onClick={() => set(withoutBlock(draft, i))}
                >
                  ✕
                </Button>
              </li>
            ))}
          </ol>
        </>
      ) : null}
      <Button id="another-block" kind="link-button" onClick={() => set(withAnother(draft))}>
        {say("blocks.another")}
      </Button>
      <Fault field="blocks" />
    </fieldset>
  );
}
