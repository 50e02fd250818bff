import "./Files.css";
import { useComputed, useSignal, useSignalEffect } from "@preact/signals";
import { api, ServiceError } from "../../api/client";
import type { ProductView, QualityView } from "../../api/types";
import { chosenHref, type FileOption, fileChoice, taken } from "../../state/fileChoice";
import { duration, fixed, megabytes } from "../../state/format";
import { mission, now, selectedId, view } from "../../state/store";
import { LANGUAGES, language, OWN_NAMES, say } from "../../words/say";
import { mapPicture, type PictureKind, shownChart } from "../chart/mapPicture";
import { Button, Choice, into, same } from "../parts/Controls";
import { save } from "../parts/download";

/** Metres between contours that are offered. */
const INTERVALS_M = ["0.1", "0.2", "0.5", "1", "2", "5", "10", "20", "50"];

/** A file that is on its way. */
interface Making {
  since: number;
  /** Bytes that have come; 0 while the service makes it. */
  received: number;
  stop: AbortController;
}

/** What can be downloaded of the mission, and what may be said of its map's uncertainty. */
export function Files() {
  const products = useSignal<ProductView[]>([]);
  const quality = useSignal<QualityView | null>(null);
  const making = useSignal<Readonly<Record<string, Making>>>({});
  const fault = useSignal("");
  const vehicle = useSignal("");
  const vehicles = useComputed(() => (mission.value?.vehicles ?? []).map(({ name }) => name));
  const hasMap = useComputed(() => view.value.mapVersion > 0);

  useSignalEffect(() => {
    const id = selectedId.value;
    products.value = [];
    fault.value = "";
    vehicle.value = "";
    if (!id) return;
    api.products(id).then(
      (list) => {
        if (selectedId.peek() === id) products.value = list;
      },
      (error) => {
        if (selectedId.peek() === id) fault.value = said(error);
      },
    );
  });

  useSignalEffect(() => {
    const id = selectedId.value;
    quality.value = null;
    if (!id || !hasMap.value) return;
    api.quality(id).then(
      (found) => {
        if (selectedId.peek() === id) quality.value = found;
      },
      () => {
        // Nothing is known of it; the live socket tells where the service is gone.
      },
    );
  });

  const download = async (product: ProductView) => {
    const stop = new AbortController();
    const since = Date.now();
    const note = (received: number) => {
      making.value = { ...making.peek(), [product.name]: { since, received, stop } };
    };
    note(0);
    fault.value = "";
    try {
      const choice = { lang: language.value, ...fileChoice.value, vehicle: vehicle.value };
      const file = await api.file(chosenHref(product, choice), note, stop.signal);
      save(file.name, file.content);
    } catch (error) {
      if (!stop.signal.aborted) fault.value = `${product.name}: ${said(error)}`;
    } finally {
      const { [product.name]: _, ...others } = making.peek();
      making.value = others;
    }
  };

  const picture = async (kind: PictureKind) => {
    fault.value = "";
    try {
      const file = await mapPicture(kind);
      save(file.name, file.content);
    } catch (error) {
      fault.value = said(error);
    }
  };

  return (
    <div class="log files" data-testid="files">
      {fault.value ? (
        <p class="alarm" role="alert" data-testid="file-fault">
          ✕ {fault.value}
        </p>
      ) : null}
      <Options products={products.value} />
      <Quality found={quality.value} />
      <ul>
        {(["png", "pdf"] as const).map((kind) => (
          <li key={kind}>
            <Button id={`picture-${kind}`} disabled={!shownChart.value} onClick={() => void picture(kind)}>
              {`map.${kind}`}
            </Button>
            <span>{say("picture.asShown")}</span>
          </li>
        ))}
        {products.value.map((product) => (
          <li key={product.name}>
            <Button
              id={`file-${product.name}`}
              disabled={product.needs_map && !hasMap.value}
              busy={making.value[product.name] !== undefined}
              onClick={() => download(product)}
            >
              {product.name}
            </Button>
            <span>{product.title}</span>
            {product.options.includes("vehicle") && vehicles.value.length > 1 ? (
              <Choice
                label={say("log.vehicle")}
                value={vehicle.value}
                options={[["", say("files.ofWhichVehicle")], ...same(vehicles.value)]}
                id={`vehicle-${product.name}`}
                onChoose={into(vehicle)}
              />
            ) : null}
            {making.value[product.name] ? (
              <Progress making={making.value[product.name] as Making} name={product.name} />
            ) : null}
          </li>
        ))}
      </ul>
      {hasMap.value ? null : <p class="empty">{say("files.filesOfTheMapFollowWith")}</p>}
    </div>
  );
}

/** What is asked of all files that take it. */
function Options({ products }: { products: readonly ProductView[] }) {
  const one = (
    option: FileOption,
    words: string,
    choices: readonly (readonly [string, string])[],
    value = "",
  ) =>
    taken(products, option) ? (
      <label class="field">
        {words}
        <Choice
          value={fileChoice.value[option] ?? value}
          options={choices}
          id={`files-${option}`}
          onChoose={(chosen) => {
            fileChoice.value = { ...fileChoice.peek(), [option]: chosen };
          }}
        />
      </label>
    ) : null;
  return (
    <div class="filters" data-testid="file-options">
      {one("crs", say("files.grid"), [
        ["", say("files.own")],
        ["utm", "UTM"],
      ])}
      {one("interval_m", say("files.contourInterval"), [
        ["", say("files.aboutTen")],
        ...INTERVALS_M.map((metres) => [metres, `${metres} m`] as const),
      ])}
      {one(
        "order",
        say("files.order"),
        [
          ["exclusive", say("files.exclusive")],
          ["special", say("files.special")],
          ...same(["1a", "1b", "2"]),
        ],
        "1a",
      )}
      {one(
        "lang",
        say("files.report"),
        LANGUAGES.map((name) => [name, OWN_NAMES[name]] as const),
        language.value,
      )}
    </div>
  );
}

/** How a file comes along: how long the service has been making it, then how much has come. */
function Progress({ making: { since, received, stop }, name }: { making: Making; name: string }) {
  const seconds = Math.max(0, (now.value - since) / 1000);
  return (
    <>
      <small role="status" data-testid="making">
        {received === 0
          ? say("files.beingMade", { seconds: duration(seconds) })
          : say("files.received", { received: megabytes(received) })}
      </small>
      <Button
        id={`stop-${name}`}
        kind="link-button"
        aria-label={say("files.cancelFile", { name })}
        onClick={() => stop.abort()}
      >
        {say("mission.cancel")}
      </Button>
    </>
  );
}

function Quality({ found }: { found: QualityView | null }) {
  if (!found) return null;
  return (
    <div data-testid="quality">
      <p>{say("files.depthsAreBelow", { verticalDatum: found.vertical_datum })}</p>
      <ul class="statements">
        {found.tvu.map((one) => (
          <li key={one.order}>{one.statement}</li>
        ))}
      </ul>
      {found.difference ? (
        <p>
          {say("files.differenceToTheReferenceGrid", {
            rmseM: fixed(found.difference.rmse_m, 2),
            biasM: fixed(found.difference.bias_m, 2),
            p95M: fixed(found.difference.p95_m, 2),
          })}
        </p>
      ) : null}
    </div>
  );
}

function said(error: unknown): string {
  return error instanceof ServiceError
    ? [error.message, error.remedy].filter(Boolean).join(". ")
    : String(error);
}
