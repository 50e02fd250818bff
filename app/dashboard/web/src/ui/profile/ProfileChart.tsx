import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import {
  type Cut,
  type CutPoint,
  depthsOf,
  nearestIndex,
  piecesOf,
  ticksOf,
} from "../../state/analysis/profile";
import { distance, fixed, metres, plain } from "../../state/format";
import { marked } from "../../state/store";
import { say } from "../../words/say";

const HEIGHT = 220;
const MARGIN = { left: 52, right: 14, top: 10, bottom: 26 };

/** Depths of surveys along a line, deeper is lower: bands of two deviations, guesses broken, soundings as dots. */
export function ProfileChart({ cuts, none_m }: { cuts: readonly Cut[]; none_m: number }) {
  const box = useRef<HTMLDivElement>(null);
  const width = useSignal(640);
  const at = useSignal<number | null>(null);
  useEffect(() => {
    const element = box.current;
    if (!element) return;
    const watcher = new ResizeObserver(() => {
      width.value = Math.max(260, element.clientWidth);
    });
    watcher.observe(element);
    return () => watcher.disconnect();
  }, []);
  const depths = depthsOf(cuts, none_m);
  const length_m = Math.max(...cuts.map(({ profile }) => profile.length_m));
  if (!depths) return <p class="empty">{say("profile.nothingKnown")}</p>;
  const across = width.value - MARGIN.left - MARGIN.right;
  const down = HEIGHT - MARGIN.top - MARGIN.bottom;
  const x = (along_m: number) => MARGIN.left + (along_m / length_m) * across;
  const y = (depth_m: number) => MARGIN.top + ((depth_m - depths.low) / (depths.high - depths.low)) * down;
  const path = (points: readonly CutPoint[], of: (point: CutPoint) => number) =>
    points.map((p) => `${x(p.along_m).toFixed(1)},${y(of(p)).toFixed(1)}`);
  const show = (index: number | null) => {
    at.value = index;
    const [first] = cuts;
    const place = index === null ? undefined : first?.profile.positions[index];
    if (place) marked.value = { at: [place[0], place[1]] };
  };
  const points = cuts[0]?.profile.along_m ?? [];
  const here = at.value === null ? undefined : points[at.value];
  const index = at.value ?? 0;
  const words =
    here === undefined
      ? say("profile.point")
      : [
          distance(here, 1),
          ...cuts.map(({ name, profile }) => {
            const [depth, sd] = [profile.depth_m[index], profile.sd_m[index]];
            const known = depth != null && sd != null && (profile.sounded[index] || sd < none_m);
            return `${name}: ${known ? `${metres(depth, 2)} ± ${fixed(sd, 2)}` : say("asked.notKnown")}`;
          }),
        ].join(" · ");
  return (
    <div ref={box} class="profile-chart">
      <svg
        width={width.value}
        height={HEIGHT}
        role="img"
        aria-label={say("profile.chart", { names: cuts.map(({ name }) => name).join(", ") })}
        data-testid="profile-chart"
        onPointerMove={(event) => {
          const { left } = event.currentTarget.getBoundingClientRect();
          show(nearestIndex(points, ((event.clientX - left - MARGIN.left) / across) * length_m));
        }}
      >
        {ticksOf(depths.low, depths.high, 5).map((depth) => (
          <g key={`d${depth}`}>
            <line class="grid" x1={MARGIN.left} x2={width.value - MARGIN.right} y1={y(depth)} y2={y(depth)} />
            <text x={MARGIN.left - 6} y={y(depth) + 4} text-anchor="end">
              {plain(depth)}
            </text>
          </g>
        ))}
        {ticksOf(0, length_m, Math.max(2, across / 90)).map((along) => (
          <g key={`a${along}`}>
            <line class="grid" x1={x(along)} x2={x(along)} y1={MARGIN.top} y2={MARGIN.top + down} />
            <text x={x(along)} y={HEIGHT - 8} text-anchor="middle">
              {distance(along, along % 1 === 0 ? 0 : 1)}
            </text>
          </g>
        ))}
        {cuts.map(({ id, colour, profile }) => (
          <g key={id} style={{ color: colour }}>
            {piecesOf(profile, none_m).map(({ sounded, points: piece }) => {
              const upper = path(piece, (p) => p.depth_m - 2 * p.sd_m);
              const lower = path(piece, (p) => p.depth_m + 2 * p.sd_m).reverse();
              return (
                <g key={`${piece[0]?.along_m} ${sounded}`}>
                  <polygon class="band" points={[...upper, ...lower].join(" ")} />
                  <polyline
                    class={sounded ? "cut" : "cut guessed"}
                    points={path(piece, (p) => p.depth_m).join(" ")}
                  />
                </g>
              );
            })}
            {profile.soundings.map((one) => (
              <circle
                key={`${one.along_m} ${one.across_m} ${one.depth_m}`}
                cx={x(one.along_m)}
                cy={y(one.depth_m)}
                r={1.6}
              />
            ))}
          </g>
        ))}
        {here === undefined ? null : (
          <line class="here" x1={x(here)} x2={x(here)} y1={MARGIN.top} y2={MARGIN.top + down} />
        )}
      </svg>
      <input
        type="range"
        min={0}
        max={Math.max(points.length - 1, 0)}
        value={at.value ?? 0}
        aria-label={say("profile.place")}
        aria-valuetext={words}
        style={{ marginLeft: `${MARGIN.left - 8}px`, width: `${across + 16}px` }}
        data-testid="profile-place"
        onInput={(event) => show(Number(event.currentTarget.value))}
      />
      <p class="small" data-testid="profile-here">
        {words}
      </p>
    </div>
  );
}
