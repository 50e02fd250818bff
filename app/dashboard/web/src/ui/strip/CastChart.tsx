import type { VehicleCastView } from "../../api/types";
import { ticksOf } from "../../state/analysis/profile";
import { fixed, metres, plain } from "../../state/format";
import { say } from "../../words/say";

const [WIDTH, HEIGHT] = [320, 150];
const MARGIN = { left: 34, right: 12, top: 6, bottom: 30 };
/** No narrower, so that noise in a mixed water does not look like a thermocline. */
const LEAST_MPS = 2;

/** A sound speed profile, deeper is lower; bars are the standard deviation of single speeds in their bin of depth. */
export function CastChart({ cast: { profile, bins, vehicle } }: { cast: VehicleCastView }) {
  const sdOf = (i: number): number => bins?.[i]?.[1] ?? 0;
  const speeds = profile.flatMap(([, speed], i) => [speed - sdOf(i), speed + sdOf(i)]);
  const middle = (Math.min(...speeds) + Math.max(...speeds)) / 2;
  const half = Math.max(LEAST_MPS, Math.max(...speeds) - Math.min(...speeds)) / 2;
  const deepest_m = Math.max(...profile.map(([depth_m]) => depth_m));
  const across = WIDTH - MARGIN.left - MARGIN.right;
  const down = HEIGHT - MARGIN.top - MARGIN.bottom;
  const x = (speed: number) => MARGIN.left + ((speed - middle + half) / (2 * half)) * across;
  const y = (depth_m: number) => MARGIN.top + (depth_m / deepest_m) * down;
  return (
    <svg
      class="cast-chart"
      viewBox={`0 0 ${WIDTH} ${HEIGHT}`}
      role="img"
      aria-label={say("casts.chart", { vehicle })}
      data-testid="cast-chart"
    >
      {ticksOf(0, deepest_m, 4).map((depth_m) => (
        <g key={`d${depth_m}`}>
          <line class="grid" x1={MARGIN.left} x2={WIDTH - MARGIN.right} y1={y(depth_m)} y2={y(depth_m)} />
          <text x={MARGIN.left - 5} y={y(depth_m) + 4} text-anchor="end">
            {plain(depth_m)}
          </text>
        </g>
      ))}
      {ticksOf(middle - half, middle + half, 5).map((speed) => (
        <g key={`s${speed}`}>
          <line class="grid" x1={x(speed)} x2={x(speed)} y1={MARGIN.top} y2={MARGIN.top + down} />
          <text x={x(speed)} y={MARGIN.top + down + 13} text-anchor="middle">
            {plain(speed)}
          </text>
        </g>
      ))}
      <text x={MARGIN.left + across / 2} y={HEIGHT - 3} text-anchor="middle">
        {say("casts.axes")}
      </text>
      {profile.map(([depth_m, speed], i) => (
        <line
          key={depth_m}
          class="spread"
          x1={x(speed - sdOf(i))}
          x2={x(speed + sdOf(i))}
          y1={y(depth_m)}
          y2={y(depth_m)}
        >
          <title>
            {say("casts.bin", {
              depth: metres(depth_m, 1),
              speed: fixed(speed, 1),
              sd: fixed(sdOf(i), 1),
              samples: plain(bins?.[i]?.[0] ?? 0),
            })}
          </title>
        </line>
      ))}
      <polyline
        class="speed"
        points={profile.map(([d, s]) => `${x(s).toFixed(1)},${y(d).toFixed(1)}`).join(" ")}
      />
    </svg>
  );
}
