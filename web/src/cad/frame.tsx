// Axes and grid over the picture.

import { signal } from "@preact/signals";
import type { JSX } from "preact";
import { right } from "../camera";
import type { Sight } from "../overlay";
import { rig, scene } from "../store";
import { dot, length, sub, type Vec3 } from "../vec";
import { grid, segment } from "./lines";
import { AXES } from "./plane";

export const showsAxes = signal(false);
export const showsGrid = signal(false);

/** Lines nearer to the eye than this share of the scene's size are not drawn. */
const NEAR = 1e-3;

function sizeOf([low, high]: [Vec3, Vec3]): number {
  return length(sub(high, low)) || 1;
}

export function GridLines({ sight }: { sight: Sight }): JSX.Element | null {
  const info = scene.value;
  const up = rig.value?.worldUp;
  if (!showsGrid.value || !info || !up) return null;
  const bounds = info.bounds as [Vec3, Vec3];
  const near = NEAR * sizeOf(bounds);
  const { lines, labels, step } = grid(bounds, up);
  return (
    <g class="grid">
      {lines.map((line) => {
        const seen = segment(sight.camera, sight.size, line, near);
        return seen && <line {...seen} />;
      })}
      {labels.map(({ at, text }) => {
        const seen = sight.place(at);
        return (
          seen && (
            <text x={seen.x} y={seen.y} font-size={11 * sight.unit} text-anchor="middle">
              {text}
            </text>
          )
        );
      })}
      <text
        x={sight.size[0] - 8 * sight.unit}
        y={sight.size[1] - 44 * sight.unit}
        font-size={12 * sight.unit}
        text-anchor="end"
      >
        one cell: {step}
      </text>
    </g>
  );
}

/** The axes of the world from its origin, and their directions in the corner. */
export function AxesLines({ sight }: { sight: Sight }): JSX.Element | null {
  const info = scene.value;
  if (!showsAxes.value || !info) return null;
  const { camera, size, unit } = sight;
  const bounds = info.bounds as [Vec3, Vec3];
  const reach = sizeOf(bounds) / 2;
  const [x, y, arm] = [46 * unit, size[1] - 46 * unit, 30 * unit];
  // What points at the viewer is drawn last.
  const arms = AXES.map(({ name, axis }) => ({
    name,
    dx: dot(axis, right(camera)) * arm,
    dy: -dot(axis, camera.up) * arm,
    depth: dot(axis, camera.towards),
  })).sort((a, b) => b.depth - a.depth);
  return (
    <g class="axes">
      {AXES.map(({ name, axis }) => {
        const end = axis.map((v) => v * reach) as Vec3;
        const seen = segment(camera, size, [[0, 0, 0], end], NEAR * reach);
        return seen && <line class={`axis ${name}`} {...seen} />;
      })}
      {arms.map(({ name, dx, dy }) => (
        <g class={`axis ${name}`}>
          <line x1={x} y1={y} x2={x + dx} y2={y + dy} />
          <text
            x={x + dx * 1.32}
            y={y + dy * 1.32 + 4 * unit}
            font-size={12 * unit}
            text-anchor="middle"
          >
            {name}
          </text>
        </g>
      ))}
    </g>
  );
}
