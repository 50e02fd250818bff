import { useComputed, useSignal, useSignalEffect } from "@preact/signals";
import { api, ServiceError } from "../api/client";
import type { ProductView, QualityView } from "../api/types";
import { mission, selectedId, view } from "../state/store";

/** What can be downloaded of the mission, and what may be said of its map's uncertainty. */
export function Files() {
  const products = useSignal<ProductView[]>([]);
  const quality = useSignal<QualityView | null>(null);
  const busy = useSignal("");
  const fault = useSignal("");
  const hasMap = useComputed(() => view.value.mapVersion > 0);

  useSignalEffect(() => {
    const id = selectedId.value;
    if (!id) return;
    api.products(id).then(
      (list) => {
        products.value = list;
      },
      (error) => {
        fault.value = said(error);
      },
    );
  });

  useSignalEffect(() => {
    const id = selectedId.value;
    if (!id || !hasMap.value) return;
    api.quality(id).then(
      (found) => {
        quality.value = found;
      },
      () => {
        quality.value = null;
      },
    );
  });

  const offered = useComputed(() => {
    const id = selectedId.value;
    return id && mission.value?.spec.search ? [...products.value, obstaclesOf(id)] : products.value;
  });

  const download = async (product: ProductView) => {
    busy.value = product.name;
    fault.value = "";
    try {
      const file = await api.file(product.href);
      const address = URL.createObjectURL(file.content);
      const link = document.createElement("a");
      link.href = address;
      link.download = file.name;
      link.click();
      URL.revokeObjectURL(address);
    } catch (error) {
      fault.value = said(error);
    } finally {
      busy.value = "";
    }
  };

  return (
    <div class="log files" data-testid="files">
      {fault.value ? (
        <p class="alarm" role="alert" data-testid="file-fault">
          ✕ {fault.value}
        </p>
      ) : null}
      <Quality found={quality.value} />
      <ul>
        {offered.value.map((product) => (
          <li key={product.name}>
            <button
              type="button"
              class="command"
              disabled={busy.value !== "" || (product.needs_map && !hasMap.value)}
              data-testid={`file-${product.name}`}
              onClick={() => download(product)}
            >
              {busy.value === product.name ? "…" : product.name}
            </button>
            <span>{product.title}</span>
          </li>
        ))}
      </ul>
      {hasMap.value ? null : <p class="empty">Files of the map follow with the first accepted sounding.</p>}
    </div>
  );
}

/** What a search alone has to offer. */
function obstaclesOf(id: string): ProductView {
  return {
    name: "obstacles.geojson",
    title: "Obstacles of the search, known and found",
    media_type: "application/geo+json",
    href: `/api/v1/missions/${encodeURIComponent(id)}/search/obstacles.geojson`,
    needs_map: false,
  };
}

function Quality({ found }: { found: QualityView | null }) {
  if (!found) return null;
  return (
    <div data-testid="quality">
      <p>Depths are below {found.vertical_datum}.</p>
      <ul class="statements">
        {found.tvu.map((one) => (
          <li key={one.order}>{one.statement}</li>
        ))}
      </ul>
      {found.difference ? (
        <p>
          Difference to the reference grid: RMSE {found.difference.rmse_m.toFixed(2)} m, bias{" "}
          {found.difference.bias_m.toFixed(2)} m, 95 % within {found.difference.p95_m.toFixed(2)} m.
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
