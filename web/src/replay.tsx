// The traversal of acceleration structures by a ray, side by side in 3D: the regions that each
// visits, in order.

import { type Signal, useSignal, useSignalEffect } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import type { Report, StepReport, TraceReport } from "./protocol.gen";
import { add, dot, length, mul, rotate, sub, type Vec3 } from "./vec";

/** The view that all canvases share. */
interface Look {
  yaw: number;
  pitch: number;
  zoom: number;
}

/** What is drawn on every canvas. */
interface Stage {
  center: Vec3;
  radius: number;
  up: Vec3;
  report: Report;
}

/** Seconds that the replay of the longest trace takes. */
const SECONDS = 8;

/** The corners of a box and its edges, as signs along the axes. */
const EDGES: [number, number][] = [];
for (let a = 0; a < 8; a++) for (const bit of [1, 2, 4]) if (!(a & bit)) EDGES.push([a, a | bit]);

const counted = (n: number, what: string): string =>
  `${n.toLocaleString("en")} ${what}${n === 1 ? "" : "s"}`;

/** The lines that draw a region of a trace, in world space. */
export function outline(region: Pick<StepReport, "kind" | "center" | "axes">): Vec3[][] {
  const at = (...signs: number[]): Vec3 =>
    signs.reduce<Vec3>(
      (sum, s, i) => add(sum, mul(region.axes[i] as Vec3, s)),
      region.center as Vec3,
    );
  switch (region.kind) {
    case "stretch":
      return [[at(-1), at(1)]];
    case "plane":
      return [[at(-1, -1), at(1, -1), at(1, 1), at(-1, 1), at(-1, -1)]];
    case "ball": {
      const turns = Array.from({ length: 25 }, (_, i) => (i / 24) * 2 * Math.PI);
      return [
        turns.map((t) => at(Math.cos(t), Math.sin(t), 0)),
        turns.map((t) => at(Math.cos(t), 0, Math.sin(t))),
        turns.map((t) => at(0, Math.cos(t), Math.sin(t))),
      ];
    }
    default:
      return EDGES.map(([a, b]) =>
        [a, b].map((n) => at(n & 1 ? 1 : -1, n & 2 ? 1 : -1, n & 4 ? 1 : -1)),
      );
  }
}

/** Bounds of the scene, without what is far away from most of it. */
export function stageOf(report: Report, up: Vec3): Stage {
  const points = report.cloud as Vec3[];
  const all = points.length > 0 ? points : (report.bounds as Vec3[]);
  const middle = (axis: number): number =>
    all.map((p) => p[axis]).sort((a, b) => a - b)[Math.floor(all.length / 2)];
  const center: Vec3 = [middle(0), middle(1), middle(2)];
  const distances = all.map((p) => length(sub(p, center))).sort((a, b) => a - b);
  const radius = 1.3 * (distances[Math.floor(distances.length * 0.7)] ?? 0) || 1;
  return { center, radius, up, report };
}

/** A point of the world on a canvas. */
function projector(
  stage: Stage,
  look: Look,
  width: number,
  height: number,
): (p: Vec3) => [number, number] {
  const flat: Vec3 = Math.abs(stage.up[1]) > 0.5 ? [0, 0, 1] : [0, -1, 0];
  const towards = rotate(flat, stage.up, look.yaw);
  const right: Vec3 = rotate(
    Math.abs(stage.up[1]) > 0.5 ? [1, 0, 0] : [1, 0, 0],
    stage.up,
    look.yaw,
  );
  const back = rotate(towards, right, -look.pitch);
  const top = rotate(stage.up, right, -look.pitch);
  const scale = ((0.42 * Math.min(width, height)) / stage.radius) * look.zoom;
  return (p) => {
    const v = sub(p, stage.center);
    const depth = 1 / Math.max(0.25, 1 - (dot(v, back) / stage.radius) * 0.12);
    return [width / 2 + dot(v, right) * scale * depth, height / 2 - dot(v, top) * scale * depth];
  };
}

function draw(
  canvas: HTMLCanvasElement,
  stage: Stage,
  look: Look,
  trace: TraceReport,
  step: number,
): void {
  const ratio = devicePixelRatio;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (width === 0) return;
  [canvas.width, canvas.height] = [width * ratio, height * ratio];
  const context = canvas.getContext("2d")!;
  context.scale(ratio, ratio);
  const project = projector(stage, look, width, height);
  const style = getComputedStyle(canvas);
  const color = (name: string): string => style.getPropertyValue(name).trim();
  const lines = (paths: Vec3[][], stroke: string, lineWidth: number, dash: number[] = []): void => {
    context.strokeStyle = stroke;
    context.lineWidth = lineWidth;
    context.setLineDash(dash);
    context.beginPath();
    for (const path of paths)
      path.forEach((p, i) => {
        if (i === 0) context.moveTo(...project(p));
        else context.lineTo(...project(p));
      });
    context.stroke();
  };

  context.fillStyle = color("--cloud");
  for (const p of stage.report.cloud) {
    const [x, y] = project(p as Vec3);
    context.fillRect(x - 0.6, y - 0.6, 1.3, 1.3);
  }

  const shown = trace.steps.slice(0, step);
  shown.forEach((region, i) => {
    const age = shown.length - 1 - i;
    context.globalAlpha = Math.max(0.16, 0.85 ** age);
    lines(outline(region), color(region.is_leaf ? "--leaf" : "--node"), age === 0 ? 2 : 1);
  });
  context.globalAlpha = 1;

  // Draws the ray as far as it has come, and the rest of the path faintly.
  const { vertices } = stage.report.tree;
  const first = vertices[0];
  if (!first) return;
  const far = (v: { origin: number[]; direction: number[] }): Vec3 =>
    add(v.origin as Vec3, mul(v.direction as Vec3, stage.radius * 2));
  context.globalAlpha = 0.45;
  for (const v of vertices.slice(1))
    lines([[v.origin as Vec3, (v.position as Vec3 | null) ?? far(v)]], color("--path"), 1);
  for (const light of vertices.flatMap((v) => v.lights)) {
    const end = (light.end as Vec3 | null) ?? far(light);
    lines(
      [[light.origin as Vec3, end]],
      color(light.is_blocked ? "--blocked" : "--light"),
      1,
      light.is_blocked ? [3, 3] : [],
    );
  }
  context.globalAlpha = 1;
  lines(
    [[first.origin as Vec3, (first.position as Vec3 | null) ?? far(first)]],
    color("--ray"),
    1.6,
  );
  context.setLineDash([]);
  const [ex, ey] = project(first.origin as Vec3);
  context.fillStyle = color("--ray");
  context.fillRect(ex - 2.5, ey - 2.5, 5, 5);
  if (trace.distance !== null && step >= trace.steps.length) {
    const [x, y] = project(add(first.origin as Vec3, mul(first.direction as Vec3, trace.distance)));
    context.beginPath();
    context.arc(x, y, 3.5, 0, 7);
    context.fill();
  }
}

function One(props: {
  stage: Stage;
  look: Signal<Look>;
  step: Signal<number>;
  trace: TraceReport;
  most: number;
}): JSX.Element {
  const { stage, look, step, trace } = props;
  const canvas = useRef<HTMLCanvasElement>(null);
  const size = useSignal(0);
  useEffect(() => {
    const resized = new ResizeObserver(() => (size.value += 1));
    resized.observe(canvas.current!);
    return () => resized.disconnect();
  }, []);
  useEffect(() => {
    if (canvas.current) draw(canvas.current, stage, look.value, trace, step.value);
  }, [stage, look.value, trace, step.value, size.value]);
  const now = trace.steps[Math.min(step.value, trace.steps.length) - 1];
  const tested = trace.steps.slice(0, step.value).reduce((sum, s) => sum + s.tested, 0);
  const isDone = step.value >= trace.steps.length;
  const drag = (event: PointerEvent): void => {
    if (event.buttons === 0) return;
    const { yaw, pitch, zoom } = look.value;
    look.value = {
      yaw: yaw - event.movementX * 0.01,
      pitch: Math.max(-1.5, Math.min(1.5, pitch + event.movementY * 0.01)),
      zoom,
    };
  };
  return (
    <figure class="trace">
      <figcaption>
        <strong>{trace.accelerator}</strong>
        <span class="quiet">
          {[
            counted(trace.nodes, "node"),
            counted(trace.cells, "cell"),
            counted(trace.primitives, "test"),
          ]
            .filter((t) => !t.startsWith("0"))
            .join(", ")}
        </span>
      </figcaption>
      <canvas
        ref={canvas}
        role="img"
        aria-label={
          `${trace.accelerator}: ${trace.nodes} nodes, ${trace.cells} cells, ` +
          `${trace.primitives} tests`
        }
        onPointerDown={(e) => e.currentTarget.setPointerCapture(e.pointerId)}
        onPointerMove={drag}
        onWheel={(e) => {
          e.preventDefault();
          look.value = {
            ...look.value,
            zoom: Math.max(0.2, Math.min(40, look.value.zoom * Math.exp(-e.deltaY * 0.001))),
          };
        }}
      />
      <small class={isDone ? "end" : ""}>
        {isDone
          ? trace.distance === null
            ? "nothing hit"
            : `hit after ${counted(trace.steps.length, "step")}`
          : `step ${step.value} of ${trace.steps.length}`}
        {!isDone && now && now.tested > 0 && `, ${tested} tested`}
        {trace.left_out > 0 && ` and ${trace.left_out} more`}
      </small>
    </figure>
  );
}

/** All structures of a report, with one clock and one point of view. */
export function Replay(props: { report: Report; up: Vec3; askAll?: () => void }): JSX.Element {
  const { report } = props;
  const stage = stageOf(report, props.up);
  const look = useSignal<Look>({ yaw: 0.7, pitch: 0.5, zoom: 1 });
  const most = Math.max(1, ...report.traces.map((j) => j.steps.length));
  const step = useSignal(most);
  const playing = useSignal(false);
  useEffect(() => {
    step.value = most;
  }, [report]);
  useSignalEffect(() => {
    if (!playing.value) return;
    let last = performance.now();
    // Steps a second: at least six, and at least as many as are shown already, so long traces get
    // faster.
    let at = step.peek() >= most ? 0 : step.peek();
    let frame = requestAnimationFrame(function tick(now) {
      const share = Math.max(6, at, most / SECONDS);
      at += ((now - last) / 1000) * share;
      last = now;
      step.value = Math.min(most, Math.ceil(at));
      if (step.peek() >= most) playing.value = false;
      else frame = requestAnimationFrame(tick);
    });
    return () => cancelAnimationFrame(frame);
  });
  return (
    <section class="replay" aria-label="the ray's traversal of acceleration structures">
      <div class="controls">
        <button class="accent" onClick={() => (playing.value = !playing.value)}>
          {playing.value ? "Pause" : "Replay"}
        </button>
        <input
          type="range"
          min="0"
          max={most}
          step="1"
          value={step.value}
          aria-label="steps shown"
          onInput={(e) => {
            playing.value = false;
            step.value = Number(e.currentTarget.value);
          }}
        />
        <span class="legend">
          <i class="node" /> node <i class="leaf" /> leaf or cell <i class="ray" /> ray{" "}
          <i class="light" /> light
        </span>
        {props.askAll && report.traces.length === 1 && (
          <button onClick={props.askAll}>Build the others too</button>
        )}
      </div>
      <div class="traces">
        {report.traces.map((trace) => (
          <One
            key={trace.accelerator}
            stage={stage}
            look={look}
            step={step}
            trace={trace}
            most={most}
          />
        ))}
      </div>
    </section>
  );
}
