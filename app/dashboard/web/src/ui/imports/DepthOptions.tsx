import type { Signal } from "@preact/signals";
import type { ImportOptions } from "../../api/types";
import { pointed } from "../../state/format";
import { say } from "../../words/say";
import { Choice, same, Typed } from "../parts/Controls";

/** What is asked of a file of depths, each as it is typed or chosen. */
export type DepthOptions = { [name in keyof ImportOptions]: Signal<string> };

/** Ready to be sent. */
export const optionsOf = (options: DepthOptions): ImportOptions => ({
  crs: options.crs.value.trim(),
  positive: options.positive.value,
  sd_m: pointed(options.sd_m.value).trim(),
  order: options.order.value,
  datum_offset_m: pointed(options.datum_offset_m.value).trim(),
  source: options.source.value.trim(),
});

/** What a file of depths does not say by itself; `weighed`: whether its depths count by their uncertainty. */
export function DepthOptionFields({
  options,
  weighed,
  id,
}: {
  options: DepthOptions;
  weighed: boolean;
  id: string;
}) {
  return (
    <details>
      <summary>{say("imports.whatTheFileDoesNotSay")}</summary>
      <div class="fields">
        <label class="field">
          {say("imports.crs")}
          <Typed text={options.crs} id={`${id}-crs`} placeholder={say("imports.crsExample")} />
        </label>
        <label class="field">
          {say("imports.values")}
          <Choice
            value={options.positive.value}
            options={[
              ["", say("imports.asTheFileSays")],
              ["down", say("imports.depths")],
              ["up", say("imports.heights")],
            ]}
            id={`${id}-positive`}
            onChoose={(value) => {
              options.positive.value = value;
            }}
          />
        </label>
        {weighed ? (
          <>
            <label class="field">
              {say("corrections.deviationM")}
              <Typed text={options.sd_m} id={`${id}-sd`} />
            </label>
            <label class="field">
              {say("imports.order")}
              <Choice
                value={options.order.value}
                options={[
                  ["", "–"],
                  ["exclusive", say("files.exclusive")],
                  ["special", say("files.special")],
                  ...same(["1a", "1b", "2"]),
                ]}
                id={`${id}-order`}
                onChoose={(value) => {
                  options.order.value = value;
                }}
              />
            </label>
          </>
        ) : null}
        <label class="field">
          {say("imports.datumOffset")}
          <Typed text={options.datum_offset_m} id={`${id}-datum-offset`} />
        </label>
        <label class="field">
          {say("imports.source")}
          <Typed text={options.source} id={`${id}-source`} maxLength={500} />
        </label>
      </div>
    </details>
  );
}
