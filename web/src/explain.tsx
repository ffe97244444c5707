// Explains why a pixel looks as it does: the origin of its light, the convergence of its samples,
// the path tree of one sample, and the traversal of its ray.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { useDismiss } from "./dismiss";
import type { Report, SampleReport, VertexReport } from "./protocol.gen";
import { Replay } from "./replay";
import { explained, type Store, scene } from "./store";
import { linearToSrgb } from "./tonemap";
import type { Vec3 } from "./vec";

/** A number with four digits that count. */
export function short(x: number): string {
  if (x === 0) return "0";
  return Math.abs(x) < 1e-4 || Math.abs(x) >= 1e6
    ? x.toExponential(2)
    : Number(x.toPrecision(4)).toString();
}

/** A colour as the screen shows it; what is brighter than 1 keeps its hue. */
export function css(color: number[]): string {
  const most = Math.max(1, ...color.slice(0, 3));
  return `rgb(${color
    .slice(0, 3)
    .map((c) => Math.round(linearToSrgb(Math.max(0, c / most)) * 255))
    .join(" ")})`;
}

const rgb = (color: number[]): string => color.slice(0, 3).map(short).join("  ");
const isBlack = (color: number[]): boolean => color.every((c) => c === 0);
const luminance = (c: number[]): number => 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];

function Swatch({ color }: { color: number[] }): JSX.Element {
  return <i class="swatch" style={{ background: css(color) }} />;
}

const LETTERS: Record<string, string> = {
  E: "eye",
  D: "diffuse",
  G: "glossy",
  S: "mirror",
  T: "through",
  V: "medium",
  L: "light",
};

function Classes({ report }: { report: Report }): JSX.Element {
  const word = (way: string): string => [...way].map((c) => LETTERS[c] ?? c).join(" → ");
  return (
    <section>
      <h3>Where its light comes from</h3>
      <table class="classes">
        <tbody>
          {report.classes.slice(0, 8).map((c) => (
            <tr key={c.way} title={`${word(c.way)}: ${rgb(c.value)}`}>
              <th>{c.way}</th>
              <td class="bar-cell">
                <i
                  style={{
                    width: `${Math.max(0, Math.min(1, c.share)) * 100}%`,
                    background: css(c.value.map((v) => v / Math.max(1e-9, ...c.value))),
                  }}
                />
              </td>
              <td>{(c.share * 100).toFixed(1)} %</td>
            </tr>
          ))}
        </tbody>
      </table>
      <small class="quiet">
        from the eye E to the light L: D diffuse, G glossy, S mirror, T through, V medium
      </small>
    </section>
  );
}

const PLOT = { width: 420, height: 150, left: 44, bottom: 16 };

/** Points of the convergence plot: lines of the mean and bands of its error, by channel. */
export function plotted(report: Report): { lines: string[]; bands: string[]; ceiling: number } {
  const points = report.convergence;
  const last = points[points.length - 1];
  if (!last) return { lines: [], bands: [], ceiling: 1 };
  const most = Math.max(...points.flatMap((p) => p.value).filter(Number.isFinite));
  const ceiling = Math.max(1e-6, Math.min(most, 3 * Math.max(...last.value))) * 1.08;
  const span = Math.max(1e-6, Math.log(last.samples) - Math.log(points[0].samples));
  const x = (n: number): number =>
    PLOT.left + (PLOT.width - PLOT.left) * ((Math.log(n) - Math.log(points[0].samples)) / span);
  const y = (v: number): number =>
    (PLOT.height - PLOT.bottom) * (1 - Math.max(0, Math.min(1, v / ceiling)));
  const at = (n: number, v: number): string => `${x(n).toFixed(1)},${y(v).toFixed(1)}`;
  const lines = [0, 1, 2].map((c) => points.map((p) => at(p.samples, p.value[c])).join(" "));
  const bands = [0, 1, 2].map((c) => {
    const upper = points.map((p) => at(p.samples, p.value[c] + p.error[c]));
    const lower = points.map((p) => at(p.samples, p.value[c] - p.error[c])).reverse();
    return [...upper, ...lower].join(" ");
  });
  return { lines, bands, ceiling };
}

function Convergence({ report }: { report: Report }): JSX.Element {
  const { lines, bands, ceiling } = plotted(report);
  const last = report.convergence[report.convergence.length - 1];
  return (
    <section>
      <h3>As the samples come in</h3>
      <svg
        class="plot"
        viewBox={`0 0 ${PLOT.width} ${PLOT.height}`}
        role="img"
        aria-label={`mean of ${report.spp} samples: ${rgb(report.value)}`}
      >
        <rect
          x={PLOT.left}
          y="0"
          width={PLOT.width - PLOT.left}
          height={PLOT.height - PLOT.bottom}
          class="frame"
        />
        {bands.map((b, c) => (
          <polygon points={b} class={`band c${c}`} />
        ))}
        {lines.map((l, c) => (
          <polyline points={l} class={`line c${c}`} />
        ))}
        <text x={PLOT.left - 4} y="10" text-anchor="end">
          {short(ceiling)}
        </text>
        <text x={PLOT.left - 4} y={PLOT.height - PLOT.bottom} text-anchor="end">
          0
        </text>
        <text x={PLOT.left} y={PLOT.height - 3}>
          1
        </text>
        <text x={PLOT.width} y={PLOT.height - 3} text-anchor="end">
          {last?.samples} samples
        </text>
      </svg>
    </section>
  );
}

/** All samples by number, as high as they are bright; one is chosen by a click. */
function Samples(props: { report: Report; choose(sample: number): void }): JSX.Element {
  const { report, choose } = props;
  const shown = report.samples.slice(0, 256);
  const most = Math.max(1e-9, ...shown.map(luminance));
  return (
    <section>
      <h3>Its samples</h3>
      <div class="samples" role="listbox" aria-label="samples of the pixel">
        {shown.map((color, number) => (
          <button
            role="option"
            aria-selected={number === report.tree.number}
            aria-label={`sample ${number}: ${rgb(color)}`}
            title={`sample ${number}: ${rgb(color)}`}
            onClick={() => choose(number)}
          >
            <i
              style={{
                height: `${Math.max(3, 100 * Math.sqrt(Math.max(0, luminance(color)) / most))}%`,
                background: css(color),
              }}
            />
          </button>
        ))}
      </div>
    </section>
  );
}

function what(vertex: VertexReport): string {
  switch (vertex.what) {
    case "surface":
      return vertex.material || "unnamed material";
    case "medium":
      return "scattered in a medium";
    case "escaped":
      return "left the scene";
    default:
      return "absorbed by media";
  }
}

function Contribution(props: { color: number[]; text: string; faint?: boolean }): JSX.Element {
  return (
    <div class={props.faint ? "contribution faint" : "contribution"}>
      <Swatch color={props.color} />
      <code>+ {rgb(props.color)}</code>
      <small>{props.text}</small>
    </div>
  );
}

function Vertex(props: { tree: SampleReport; number: number }): JSX.Element {
  const { tree, number } = props;
  const vertex = tree.vertices[number];
  const weight = (w: number): string => (w === 1 ? "" : `, MIS weight ${w.toFixed(3)}`);
  const children = tree.vertices
    .map((v, i) => [v, i] as const)
    .filter(([v]) => v.parent === number);
  return (
    <li>
      <div class="vertex">
        <b>{what(vertex)}</b>
        {vertex.object && <span class="quiet"> {vertex.object}</span>}
        <small class="quiet">
          {vertex.lobe ?? "camera"}
          {vertex.pdf !== null && `, density ${short(vertex.pdf)}/sr`}
          {vertex.distance !== null && `, ${short(vertex.distance)} away`}
        </small>
        <div class="throughput">
          <small>throughput</small> <Swatch color={vertex.throughput} />{" "}
          <code>{rgb(vertex.throughput)}</code>
        </div>
        {!isBlack(vertex.glow) && <Contribution color={vertex.glow} text="from media on the way" />}
        {!isBlack(vertex.found) && (
          <Contribution
            color={vertex.found}
            text={`light found here${weight(vertex.found_weight)}`}
          />
        )}
        {vertex.lights.map((light) => (
          <Contribution
            color={light.brought}
            faint={light.is_blocked}
            text={`${light.source}: ${light.is_blocked ? "hidden" : "seen"}${weight(light.weight)}`}
          />
        ))}
      </div>
      {children.length > 0 && (
        <ol>
          {children.map(([, i]) => (
            <Vertex key={i} tree={tree} number={i} />
          ))}
        </ol>
      )}
    </li>
  );
}

function Tree({ report }: { report: Report }): JSX.Element {
  const { tree } = report;
  return (
    <section>
      <h3>Path of sample {tree.number}</h3>
      <ol class="path-tree">{tree.vertices.length > 0 && <Vertex tree={tree} number={0} />}</ol>
      <div class="contribution total">
        <Swatch color={tree.sum} />
        <code>= {rgb(tree.sum)}</code>
        <small>the sample's value</small>
      </div>
    </section>
  );
}

/** The view over the picture. */
export function Explain({ store }: { store: Store }): JSX.Element | null {
  const report = explained.value;
  const closer = useRef<HTMLButtonElement>(null);
  const asking = useSignal(false);
  useEffect(() => closer.current?.focus(), [report === null]);
  const close = (): void => {
    store.stopExplaining();
    explained.value = null;
  };
  useDismiss(report !== null, close, { covers: true });
  if (!report) return null;
  const ask = async (sample: number | null, all = false): Promise<void> => {
    asking.value = true;
    await store.explain(report.pixel as [number, number], sample, all);
    asking.value = false;
  };
  const up = (scene.value?.up ?? [0, 1, 0]) as Vec3;
  return (
    <div
      class={asking.value ? "explain asking" : "explain"}
      role="dialog"
      aria-label={`why pixel ${report.pixel.join(", ")} looks as it does`}
      onKeyDown={(e) => {
        if (e.key === "Escape") close();
        e.stopPropagation();
      }}
    >
      <header>
        <Swatch color={report.value} />
        <h2>
          Pixel {report.pixel[0]}, {report.pixel[1]}
        </h2>
        <code>{rgb(report.value)}</code>
        <span class="quiet">
          ± {rgb(report.error)} after {report.spp} samples, {report.integrator}
        </span>
        <span class="space" />
        <button ref={closer} onClick={close}>
          Close
        </button>
      </header>
      <div class="columns">
        <div class="column">
          <Classes report={report} />
          <Convergence report={report} />
          <Samples
            report={report}
            choose={(sample) => void ask(sample, report.traces.length > 1)}
          />
          <Tree report={report} />
        </div>
        <Replay report={report} up={up} askAll={() => void ask(report.tree.number, true)} />
      </div>
    </div>
  );
}
