// The camera.

import type { JSX } from "preact";
import { type Camera, fieldOfView, withFieldOfView } from "../camera";
import { focusing, type Store, scene, view } from "../store";
import { Press } from "../touch";
import { Section, Select, Slider } from "./section";

export function CameraSection({ store }: { store: Store }): JSX.Element | null {
  const [now, info] = [view.value, scene.value];
  if (!now || !info) return null;
  const camera = now.camera;
  const change = (next: Partial<Camera>): void =>
    store.setCamera({ ...(store.rig?.camera ?? camera), ...next });
  const fov = fieldOfView(camera, now.size as [number, number]);
  const radius = Math.hypot(...info.bounds[1].map((v, i) => v - info.bounds[0][i])) / 2;
  return (
    <Section title="Camera">
      {info.cameras.length > 1 && (
        <Select
          label="From"
          value=""
          options={[
            { value: "", text: "here" },
            ...info.cameras.map((c, i) => ({ value: String(i), text: c.name || `camera ${i}` })),
          ]}
          change={(i) => i !== "" && store.useCamera(Number(i))}
        />
      )}
      {fov !== null && (
        <Slider
          label="Field of view"
          unit="°"
          min={5}
          max={140}
          step={0.5}
          value={fov}
          change={(v) => change(withFieldOfView(camera, v))}
        />
      )}
      <Slider
        label="Lens radius"
        fallback={0}
        min={0}
        max={radius * 0.05}
        step={radius * 0.0002}
        value={camera.aperture_radius}
        change={(v) => change({ aperture_radius: Math.max(0, v) })}
      />
      <Slider
        label="Focus"
        min={radius * 0.05}
        max={radius * 8}
        step={radius * 0.01}
        value={camera.focus_distance}
        change={(v) => v > 0 && change({ focus_distance: v })}
      />
      <div class="field">
        <span>Sharp at</span>
        <button aria-pressed={focusing.value} onClick={() => (focusing.value = !focusing.value)}>
          {focusing.value ? `${Press()} on the picture` : "Pick a point"}
        </button>
      </div>
      <div class="field">
        <span>Up</span>
        <button onClick={() => store.setUp([0, 1, 0])}>y</button>
        <button onClick={() => store.setUp([0, 0, 1])}>z</button>
      </div>
    </Section>
  );
}
