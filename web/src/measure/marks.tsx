// Measures over the picture: lines, points and labels.

import type { JSX } from "preact";
import type { Sight } from "../overlay";
import { tool } from "../tool";
import { add, length, mul, normalize, sub, type Vec3 } from "../vec";
import { type Measure, opposite, type Point, result } from "./geometry";
import { begun, hovered, kind, measures, NAME } from "./tool";

interface Drawn {
  x: number;
  y: number;
}

/** The lines of a measure in the world, and where its label stands. */
function figure({ kind, points }: Pick<Measure, "kind" | "points">): {
  lines: [Vec3, Vec3][];
  middle: Vec3;
} {
  const [a, b, c] = points.map((p) => p.position);
  const between = (p: Vec3, q: Vec3): Vec3 => mul(add(p, q), 0.5);
  if (kind === "thickness") {
    const end = opposite(points[0]) ?? a;
    return { lines: [[a, end]], middle: between(a, end) };
  }
  if (kind === "faces") {
    // The normals, as long as a quarter of what lies between.
    const size = Math.max(length(sub(b, a)) / 4, 1e-9);
    const normal = (p: Point): [Vec3, Vec3] => [p.position, add(p.position, mul(p.facing, size))];
    return { lines: [normal(points[0]), normal(points[1]), [a, b]], middle: between(a, b) };
  }
  if (kind === "angle") {
    const inward = add(normalize(sub(a, b)), normalize(sub(c, b)));
    const near = Math.min(length(sub(a, b)), length(sub(c, b))) / 3;
    return {
      lines: [
        [b, a],
        [b, c],
      ],
      middle: add(b, mul(normalize(inward), near)),
    };
  }
  return { lines: [[a, b]], middle: between(a, b) };
}

function Line(props: { from: Drawn | null; to: Drawn | null; class: string }): JSX.Element | null {
  const { from, to } = props;
  if (!from || !to) return null;
  return <line class={props.class} x1={from.x} y1={from.y} x2={to.x} y2={to.y} />;
}

function Dot(props: { point: Point; sight: Sight; class?: string }): JSX.Element | null {
  const at = props.sight.place(props.point.position);
  if (!at) return null;
  const r = 4 * props.sight.unit;
  const name = `mark ${props.point.snap} ${props.class ?? ""}`;
  if (props.point.snap === "corner")
    return <rect class={name} x={at.x - r} y={at.y - r} width={2 * r} height={2 * r} />;
  return <circle class={name} cx={at.x} cy={at.y} r={r} />;
}

/** A label with a plate behind it. */
export function Label(props: { at: Drawn; text: string; unit: number }): JSX.Element {
  const { at, text, unit } = props;
  const [width, height] = [(text.length * 7.2 + 12) * unit, 19 * unit];
  return (
    <g class="label">
      <rect
        x={at.x - width / 2}
        y={at.y - height / 2}
        width={width}
        height={height}
        rx={4 * unit}
      />
      <text x={at.x} y={at.y + 4.3 * unit} font-size={12.5 * unit} text-anchor="middle">
        {text}
      </text>
    </g>
  );
}

function Figure({ measure, sight }: { measure: Measure; sight: Sight }): JSX.Element {
  const { lines, middle } = figure(measure);
  const at = sight.place(middle);
  return (
    <g>
      {lines.map(([from, to]) => (
        <Line from={sight.place(from)} to={sight.place(to)} class="measure" />
      ))}
      {measure.points.map((point) => (
        <Dot point={point} sight={sight} />
      ))}
      {at && <Label at={at} text={result(measure).label} unit={sight.unit} />}
    </g>
  );
}

export function Measures({ sight }: { sight: Sight }): JSX.Element {
  const isMeasuring = tool.value?.name === NAME;
  const next = isMeasuring ? hovered.value : null;
  const points = begun.value;
  const last = points[points.length - 1];
  return (
    <g class="measures">
      {measures.value.map((measure) => (
        <Figure key={measure.id} measure={measure} sight={sight} />
      ))}
      {kind.value === "angle" && points.length === 2 && (
        <Line
          from={sight.place(points[0].position)}
          to={sight.place(points[1].position)}
          class="measure"
        />
      )}
      {last && next && (
        <Line
          from={sight.place(last.position)}
          to={sight.place(next.position)}
          class="measure begun"
        />
      )}
      {points.map((point) => (
        <Dot point={point} sight={sight} />
      ))}
      {next && <Dot point={next} sight={sight} class="next" />}
    </g>
  );
}
