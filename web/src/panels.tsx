// The side panel: render settings and the contents of the scene.

import { useSignal } from "@preact/signals";
import type { ComponentChildren, JSX } from "preact";
import { type Camera, fieldOfView, withFieldOfView } from "./camera";
import { Field, inside } from "./form";
import type { NodeInfo, SettingForm, ViewInfo } from "./protocol.gen";
import {
  choices,
  costs,
  exposure,
  focusing,
  picked,
  pickedPixel,
  type Store,
  scene,
  steers,
  tonemap,
  view,
} from "./store";
import { type SunPosition, sunDirection, sunPosition } from "./sun";
import type { Vec3 } from "./vec";

function Section(props: {
  title: string;
  open?: boolean;
  children: ComponentChildren;
}): JSX.Element {
  return (
    <details open={props.open ?? true}>
      <summary>{props.title}</summary>
      <div class="section">{props.children}</div>
    </details>
  );
}

function Select(props: {
  label: string;
  value: string;
  options: { value: string; text?: string }[];
  change(value: string): void;
}): JSX.Element {
  return (
    <label class="field">
      <span>{props.label}</span>
      <select value={props.value} onChange={(e) => props.change(e.currentTarget.value)}>
        {props.options.map((o) => (
          <option value={o.value}>{o.text ?? o.value}</option>
        ))}
      </select>
    </label>
  );
}

function Slider(props: {
  label: string;
  value: number;
  min: number;
  max: number;
  step: number;
  unit?: string;
  change(value: number): void;
}): JSX.Element {
  const set = (event: JSX.TargetedEvent<HTMLInputElement>): void => {
    const next = Number(event.currentTarget.value);
    if (event.currentTarget.value !== "" && Number.isFinite(next)) props.change(next);
  };
  const name = props.unit ? `${props.label} (${props.unit})` : props.label;
  return (
    <label class="field">
      <span>{name}</span>
      <input
        type="range"
        min={props.min}
        max={props.max}
        step={props.step}
        value={props.value}
        onInput={set}
        aria-label={name}
      />
      <input
        type="number"
        step="any"
        value={Number(props.value.toPrecision(5))}
        onChange={set}
        aria-label={name}
      />
    </label>
  );
}

/** A setting of the render that has no control of its own. */
function Setting(props: { setting: SettingForm; now: ViewInfo; store: Store }): JSX.Element {
  const { setting, now, store } = props;
  const label = setting.name.replaceAll("_", " ");
  const value = now.settings[setting.name] ?? "";
  const send = (wish: unknown): void =>
    store.send({ type: "set", name: setting.name, value: wish });
  if (setting.options.length > 0) {
    const options = setting.options.map((name) => ({ value: name }));
    const usual = { value: "", text: `default (${setting.default})` };
    return (
      <Select
        label={label}
        value={value}
        options={[usual, ...options]}
        change={(name) => send(name === "" ? null : name)}
      />
    );
  }
  return (
    <label class="field" title={setting.doc}>
      <span>{label}</span>
      <input
        type="number"
        step="any"
        value={value}
        placeholder={setting.default}
        onChange={(event) => {
          const text = event.currentTarget.value;
          send(text === "" ? null : Number(text));
        }}
        aria-label={label}
      />
    </label>
  );
}

function RenderSection({ store }: { store: Store }): JSX.Element | null {
  const [now, names] = [view.value, choices.value];
  if (!now || !names) return null;
  const options = (list: string[]): { value: string }[] => list.map((value) => ({ value }));
  return (
    <Section title="Picture">
      <Slider
        label="Exposure"
        unit="stops"
        min={-8}
        max={8}
        step={0.1}
        value={exposure.value}
        change={(v) => store.setDisplay({ exposure: v })}
      />
      <Select
        label="Tone map"
        value={tonemap.value}
        options={options(names.tonemaps)}
        change={(v) => store.setDisplay({ tonemap: v })}
      />
      <Select
        label="Show"
        value={now.aov}
        options={[{ value: "", text: "light" }, ...options(names.aovs)]}
        change={(aov) => store.send({ type: "render", aov })}
      />
      <Select
        label="Integrator"
        value={now.integrator}
        options={options(names.integrators)}
        change={(integrator) => store.send({ type: "render", integrator })}
      />
      <Slider
        label="Samples"
        min={1}
        max={1024}
        step={1}
        value={now.spp}
        change={(spp) => store.send({ type: "render", spp: Math.round(spp) })}
      />
      <Slider
        label="Bounces"
        min={0}
        max={64}
        step={1}
        value={now.max_depth}
        change={(d) => store.send({ type: "render", max_depth: Math.round(d) })}
      />
      <Select
        label="Accelerator"
        value={now.accelerator}
        options={options(names.accelerators)}
        change={(accelerator) => store.send({ type: "render", accelerator })}
      />
      <details class="more">
        <summary>More settings</summary>
        {names.settings.map((setting) => (
          <Setting key={setting.name} setting={setting} now={now} store={store} />
        ))}
      </details>
      <button onClick={() => (costs.value = !costs.value)} aria-pressed={costs.value}>
        Compare acceleration structures
      </button>
    </Section>
  );
}

function CameraSection({ store }: { store: Store }): JSX.Element | null {
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
          change={(i) => i !== "" && store.useCamera(info.cameras[Number(i)])}
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
          {focusing.value ? "Click on the picture" : "Pick a point"}
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

function SurroundingsSection({ store }: { store: Store }): JSX.Element | null {
  const info = scene.value;
  if (!info) return null;
  const up = info.up as Vec3;
  const sun = info.lights.findIndex((light) => light.light === "directional");
  const rotation = info.environment_rotation;
  if (sun < 0 && rotation === null) return null;
  const position = sun < 0 ? null : sunPosition(info.lights[sun].direction as Vec3, up);
  const move = (next: Partial<SunPosition>): void => {
    const direction = sunDirection({ ...position!, ...next }, up).map((v) =>
      Number(v.toPrecision(6)),
    );
    store.edit(`light.${sun}.direction`, direction);
  };
  return (
    <Section title="Surroundings">
      {rotation !== null && (
        <Slider
          label="Environment"
          unit="°"
          min={-180}
          max={180}
          step={1}
          value={rotation}
          change={(v) => store.edit("environment.rotation", v)}
        />
      )}
      {position && (
        <>
          <Slider
            label="Sun height"
            unit="°"
            min={-90}
            max={90}
            step={0.5}
            value={position.height}
            change={(height) => move({ height })}
          />
          <Slider
            label="Sun side"
            unit="°"
            min={-180}
            max={180}
            step={1}
            value={position.side}
            change={(side) => move({ side })}
          />
        </>
      )}
    </Section>
  );
}

function PickSection({ store }: { store: Store }): JSX.Element | null {
  const hit = picked.value;
  if (!hit) return null;
  const number = (v: number): string => Number(v.toPrecision(5)).toString();
  return (
    <Section title="Picked">
      <table class="facts">
        <tbody>
          <tr>
            <th>Object</th>
            <td>{hit.path.filter(Boolean).join(" › ") || "unnamed"}</td>
          </tr>
          <tr>
            <th>Material</th>
            <td>{hit.material_name || "unnamed"}</td>
          </tr>
          <tr>
            <th>Distance</th>
            <td>{number(hit.distance)}</td>
          </tr>
          <tr>
            <th>Position</th>
            <td>{hit.position.map(number).join(", ")}</td>
          </tr>
          <tr>
            <th>Normal</th>
            <td>{hit.normal.map(number).join(", ")}</td>
          </tr>
          <tr>
            <th>Face</th>
            <td>{hit.primitive}</td>
          </tr>
        </tbody>
      </table>
      <div class="field">
        <button
          class="accent"
          onClick={() => pickedPixel.value && void store.explain(pickedPixel.value)}
        >
          Why does it look so?
        </button>
        {hit.node !== null && (
          <button onClick={() => store.send({ type: "show", node: hit.node!, visible: false })}>
            Hide
          </button>
        )}
      </div>
    </Section>
  );
}

/** Maximum number of nodes shown without a filter. */
const SHOWN_NODES = 400;

function TreeSection({ store }: { store: Store }): JSX.Element | null {
  const filter = useSignal("");
  const info = scene.value;
  if (!info) return null;
  const depth = new Map<number, number>();
  for (const node of info.nodes)
    depth.set(node.id, node.parent === null ? 0 : (depth.get(node.parent) ?? 0) + 1);
  const wanted = filter.value.toLowerCase();
  const matches = (n: NodeInfo): boolean => !wanted || n.name.toLowerCase().includes(wanted);
  const all = info.nodes.filter(matches);
  const row = (node: NodeInfo): JSX.Element => (
    <li
      style={{ paddingLeft: `${Math.min(12, depth.get(node.id) ?? 0) * 0.7}em` }}
      class={picked.value?.node === node.id ? "picked" : ""}
    >
      <label>
        <input
          type="checkbox"
          checked={node.visible}
          aria-label={`show ${node.name}`}
          onChange={(e) =>
            store.send({ type: "show", node: node.id, visible: e.currentTarget.checked })
          }
        />
        {node.name || `node ${node.id}`}
      </label>
      {node.surfaces.length > 0 && <small>{node.surfaces.join(", ")}</small>}
    </li>
  );
  const left = all.length - SHOWN_NODES + info.nodes_left_out;
  return (
    <Section
      title={`Scene (${info.nodes.length + info.nodes_left_out} nodes)`}
      open={info.nodes.length < 30}
    >
      <input
        type="search"
        placeholder="Find by name"
        aria-label="find nodes by name"
        value={filter.value}
        onInput={(e) => (filter.value = e.currentTarget.value)}
      />
      <ul class="tree">{all.slice(0, SHOWN_NODES).map(row)}</ul>
      {left > 0 && <small>and {left} more: find them by name</small>}
    </Section>
  );
}

type Parameters = Record<string, unknown>;

function Things(props: {
  family: string;
  title: string;
  list: Parameters[];
  chosen: number | null;
  store: Store;
}): JSX.Element | null {
  const { family, list, store } = props;
  const own = useSignal<number | null>(null);
  if (list.length === 0) return null;
  const index = Math.min(own.value ?? props.chosen ?? 0, list.length - 1);
  const thing = list[index];
  const nameOf = (t: Parameters, i: number): string => (t.name as string) || `${family} ${i}`;
  const change = (path: string, value: unknown): void =>
    store.edit(`${family}.${index}${path}`, value);
  const form = choices.value?.forms[family];
  return (
    <Section title={`${props.title} (${list.length})`} open={props.chosen !== null}>
      <Select
        label="Which"
        value={String(index)}
        options={list.map((t, i) => ({ value: String(i), text: nameOf(t, i) }))}
        change={(v) => (own.value = Number(v))}
      />
      {Object.keys(thing)
        .filter((key) => key !== "name")
        .map((key) => (
          <Field
            key={`${index}.${key}`}
            label={key}
            value={thing[key] as never}
            path={`.${key}`}
            change={change}
            form={inside(form, thing as never, key)}
          />
        ))}
    </Section>
  );
}

export function Panel({ store }: { store: Store }): JSX.Element {
  const info = scene.value;
  const material = picked.value?.material ?? null;
  return (
    <aside class={steers.value ? "panel" : "panel watching"} aria-label="settings">
      <PickSection store={store} />
      <RenderSection store={store} />
      <CameraSection store={store} />
      <SurroundingsSection store={store} />
      {info && (
        <Things
          key={`m${material}`}
          family="material"
          title="Materials"
          list={info.materials}
          chosen={material}
          store={store}
        />
      )}
      {info && (
        <Things family="light" title="Lights" list={info.lights} chosen={null} store={store} />
      )}
      <TreeSection store={store} />
      {info && info.warnings.length > 0 && (
        <Section title={`Warnings (${info.warnings.length})`} open={false}>
          <ul class="warnings">
            {info.warnings.slice(0, 100).map((w) => (
              <li>{w}</li>
            ))}
          </ul>
        </Section>
      )}
    </aside>
  );
}
