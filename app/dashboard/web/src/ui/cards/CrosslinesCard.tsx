import "./CrosslinesCard.css";
import type { ComponentChildren } from "preact";
import type { AgreementView, AngleAgreementView, CrossingView, CrossoversView } from "../../api/types";
import { aboutCrossing, barsOf, outliersOf, placeOf } from "../../map/marks/crossings";
import { count, distance, fixed, metres, percent, place } from "../../state/format";
import {
  askForCrossovers,
  coordinateFormat,
  crossovers,
  crossoversWanted,
  destination,
} from "../../state/store";
import { say } from "../../words/say";
import { Button } from "../parts/Controls";
import { SystematicErrors } from "./SystematicErrors";

/** More are on the map and in the file. */
const MOST_LISTED = 100;

/** Pixels of the card's pictures. */
const [WIDTH, HEIGHT] = [260, 56];

function Frame({ children }: { children: ComponentChildren }) {
  return (
    <article
      class="card target crosslines"
      data-testid="crosslines-card"
      aria-label={say("crosslines.crosslines")}
    >
      <header>
        <h2>{say("crosslines.crosslines")}</h2>
      </header>
      {children}
    </article>
  );
}

/** How well a survey agrees with itself where its lines cross. */
export function CrosslinesCard() {
  const found = crossovers.value;
  if (crossoversWanted.value === null) {
    return (
      <Frame>
        <Button id="check-crosslines" onClick={askForCrossovers}>
          {say("crosslines.compareLinesWhereTheyCross")}
        </Button>
      </Frame>
    );
  }
  if (!found?.statistics) return null;
  return (
    <Frame>
      <Figures found={found} all={found.statistics} />
      <Differences found={found} />
      <ByAngle bins={found.by_angle} />
      <Agreements
        title={say("compare.vehicles")}
        rows={found.by_vehicles.map((one) => [
          one.vehicles[0] === one.vehicles[1] ? one.vehicles[0] : one.vehicles.join(" – "),
          one,
        ])}
      />
      <details>
        <summary>{say("crosslines.byLineWorstFirst")}</summary>
        <Agreements
          title={say("crosslines.line")}
          rows={found.by_line
            .slice(0, MOST_LISTED)
            .map((one) => [
              `${one.vehicle} ${one.line}${one.crossline ? say("crosslines.crossline") : ""}`,
              one,
            ])}
        />
      </details>
      <Outliers found={found} />
      <SystematicErrors />
    </Frame>
  );
}

function Figures({ found, all }: { found: CrossoversView; all: AgreementView }) {
  return (
    <>
      <dl class="big">
        <div title={say("crosslines.placesWhereTwoLinesCross")}>
          <dt>{say("crosslines.crossings")}</dt>
          <dd data-testid="crossings">{count(all.count)}</dd>
        </div>
        <div title={say("crosslines.shareOfDifferencesThatAreNot", { order: say("crosslines.order1a") })}>
          <dt>{say("crosslines.order1a")}</dt>
          <dd data-testid="crossings-within">{percent(all.within_pct, 1)}</dd>
        </div>
        <div title={say("crosslines.meanDifferenceBetween")}>
          <dt>{say("crosslines.mean")}</dt>
          <dd data-testid="crossings-mean">{metres(all.mean_m, 2)}</dd>
        </div>
        <div title={say("crosslines.standardDeviationOfThe")}>
          <dt>{say("crosslines.deviation")}</dt>
          <dd>{metres(all.sd_m, 2)}</dd>
        </div>
      </dl>
      <p class="small" data-testid="crosslines-length">
        {say("crosslines.crosslineOfTheWay", {
          crosslines: count(found.crosslines),
          it2: distance(1000 * found.crosslines_km),
          crosslinesPct: percent(found.crosslines_pct, 1),
        })}
      </p>
      {found.at_crosslines ? (
        <p class="small" data-testid="at-crosslines">
          {say("crosslines.withMainLinesCrossingsMean", {
            count: count(found.at_crosslines.count),
            meanM: metres(found.at_crosslines.mean_m, 2),
            sdM: metres(found.at_crosslines.sd_m, 2),
            withinPct: percent(found.at_crosslines.within_pct, 1),
            order: say("crosslines.order1a"),
          })}
        </p>
      ) : null}
    </>
  );
}

function Differences({ found: { histogram } }: { found: CrossoversView }) {
  const [low = 0, high = 0] = [histogram.edges_m[0], histogram.edges_m.at(-1)];
  return (
    <figure>
      <figcaption>{say("crosslines.differencesM")}</figcaption>
      <svg
        viewBox={`0 0 ${WIDTH} ${HEIGHT + 14}`}
        role="img"
        aria-label={say("crosslines.histogramOfDifferencesFromTo", {
          low: fixed(low, 2),
          high: fixed(high, 2),
        })}
        data-testid="crossings-histogram"
      >
        {barsOf(histogram.counts, WIDTH, HEIGHT).map((bar) => (
          <rect key={bar.x} class="bar" {...bar} width={bar.width - 0.5} />
        ))}
        <path class="axis" d={`M0,${HEIGHT} H${WIDTH}`} />
        <Ends low={fixed(low, 2)} middle="0" high={fixed(high, 2)} />
      </svg>
    </figure>
  );
}

function ByAngle({ bins }: { bins: readonly AngleAgreementView[] }) {
  if (bins.length === 0) return null;
  const reach_m = Math.max(0.01, ...bins.map((one) => Math.abs(one.mean_m) + (one.sd_m ?? 0)));
  const widest = Math.max(...bins.map((one) => Math.max(Math.abs(one.from_deg), one.to_deg)));
  const x = (angle: number) => (WIDTH * (angle + widest)) / (2 * widest);
  const y = (off_m: number) => (HEIGHT / 2) * (1 + off_m / reach_m);
  return (
    <figure>
      <figcaption>{say("crosslines.beamsMinusMainLinesByAngle", { reachM: fixed(reach_m, 2) })}</figcaption>
      <svg
        viewBox={`0 0 ${WIDTH} ${HEIGHT + 14}`}
        role="img"
        aria-label={say("crosslines.meanAndStandardDeviationOf")}
        data-testid="crossings-by-angle"
      >
        <path class="axis" d={`M0,${HEIGHT / 2} H${WIDTH}`} />
        {bins.map(({ from_deg, to_deg, mean_m, sd_m, count: beams, within_pct }) => {
          const middle = (from_deg + to_deg) / 2;
          return (
            <g key={from_deg}>
              <title>
                {say("crosslines.mDeviationBeams", {
                  middle,
                  meanM: fixed(mean_m, 3),
                  sdM: metres(sd_m, 3),
                  beams: count(beams),
                }) +
                  say("crosslines.within", {
                    withinPct: percent(within_pct, 1),
                    order: say("crosslines.order1a"),
                  })}
              </title>
              <path
                class="spread"
                d={`M${x(middle)},${y(mean_m - (sd_m ?? 0))} V${y(mean_m + (sd_m ?? 0))}`}
              />
              <circle class="bar" cx={x(middle)} cy={y(mean_m)} r={2.5} />
            </g>
          );
        })}
        <Ends
          low={say("crosslines.port", { widest: -widest })}
          middle="0°"
          high={say("crosslines.starboard", { widest })}
        />
      </svg>
    </figure>
  );
}

function Ends({ low, middle, high }: { low: string; middle: string; high: string }) {
  return (
    <>
      <text x={0} y={HEIGHT + 12}>
        {low}
      </text>
      <text x={WIDTH / 2} y={HEIGHT + 12} text-anchor="middle">
        {middle}
      </text>
      <text x={WIDTH} y={HEIGHT + 12} text-anchor="end">
        {high}
      </text>
    </>
  );
}

function Agreements({
  title,
  rows,
}: {
  title: string;
  rows: readonly (readonly [name: string, AgreementView])[];
}) {
  return (
    <section
      class="rows"
      aria-label={say("crosslines.differencesBy", { title: title.toLowerCase() })}
      // biome-ignore lint/a11y/noNoninteractiveTabindex: what does not fit is scrolled with the keyboard
      tabIndex={0}
    >
      <table>
        <thead>
          <tr>
            <th scope="col">{title}</th>
            <th scope="col">{say("crosslines.number")}</th>
            <th scope="col">{say("crosslines.mean")}</th>
            <th scope="col">{say("crosslines.dev")}</th>
            <th scope="col">{say("crosslines.inOrder")}</th>
          </tr>
        </thead>
        <tbody>
          {rows.map(([name, one]) => (
            <tr key={name}>
              <th scope="row">{name}</th>
              <td>{count(one.count)}</td>
              <td>{fixed(one.mean_m, 2)}</td>
              <td>{one.sd_m == null ? "–" : fixed(one.sd_m, 2)}</td>
              <td>{percent(one.within_pct)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

function Outliers({ found }: { found: CrossoversView }) {
  const shown = outliersOf(found).slice(0, MOST_LISTED);
  if (shown.length === 0) return null;
  return (
    <>
      <ol class="holidays" aria-label={say("crosslines.crossingsThatDisagreeWorst")}>
        {shown.map((crossing) => (
          <li key={crossing.number}>
            <Outlier crossing={crossing} />
          </li>
        ))}
      </ol>
      {found.outliers > shown.length ? (
        <p class="small">{say("crosslines.andMore", { outliers: count(found.outliers - shown.length) })}</p>
      ) : null}
    </>
  );
}

function Outlier({ crossing }: { crossing: CrossingView }) {
  const { number, vehicles, lines, difference_m } = crossing;
  const [one, other] = vehicles.map((name, i) => `${name} ${lines[i]}`);
  return (
    <Button
      id={`crossing-${number}`}
      kind="link-button"
      title={say("crosslines.showIt", { crossing: place(placeOf(crossing), coordinateFormat.value) })}
      onClick={() => {
        destination.value = aboutCrossing(crossing);
      }}
    >
      <span>
        {one} × {other}
      </span>{" "}
      <span>{metres(difference_m, 2)}</span>
    </Button>
  );
}
